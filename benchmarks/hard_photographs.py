"""Hard captures made from a scene's photographs: what people bring who did not take care.

Each maker fills the folder of a scene (`images/`, `video.mp4`, `transforms.json`) from a `Source`.
The same source and seed make the same files.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from shutil import copyfile

import cv2
import numpy as np

from styletrf.capture.photographs import list_photographs, read_photograph
from styletrf.capture.poses.given_poses import GivenView
from styletrf.files.video import write_video

JPEG_QUALITY = 95
FOREIGN = 5
_FRAMES_A_SECOND = 12
_LONGEST_SIDE_OF_VIDEO = 640
_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])  # from this project's axes


@dataclass(frozen=True)
class Source:
    """The photographs of a scene, those of another place, and the scene's poses if it has any."""

    photographs: Sequence[Path]
    elsewhere: Sequence[Path]
    views: Sequence[GivenView]


Maker = Callable[[Source, Path, np.random.Generator], None]


def as_they_are(source: Source, folder: Path, rng: np.random.Generator) -> None:  # noqa: ARG001
    """All photographs, to compare with."""
    _copy(source.photographs, folder)


def every_fifth(source: Source, folder: Path, rng: np.random.Generator) -> None:  # noqa: ARG001
    """Every fifth photograph."""
    _copy(source.photographs[::5], folder)


def ten(source: Source, folder: Path, rng: np.random.Generator) -> None:  # noqa: ARG001
    """Ten photographs, evenly spread."""
    chosen = np.linspace(0, len(source.photographs) - 1, 10).round().astype(int)
    _copy([source.photographs[k] for k in chosen], folder)


def portrait_crops(source: Source, folder: Path, rng: np.random.Generator) -> None:
    """Every other photograph cropped to three by four, upright, somewhere near its middle."""
    for index, (path, image) in enumerate(_read(source.photographs)):
        height, width = image.shape[:2]
        upright = round(0.75 * min(height, width)) if index % 2 else width
        left = round((width - upright) * rng.uniform(0.3, 0.7))
        _write(folder, path.stem, image[:, left : left + upright])


def varied_colors(source: Source, folder: Path, rng: np.random.Generator) -> None:
    """Gamma, exposure and white balance of each photograph varied by up to 20 %."""
    for path, image in _read(source.photographs):
        _write(folder, path.stem, _varied(image, rng))


def tourists(source: Source, folder: Path, rng: np.random.Generator) -> None:
    """Every photograph in one of ten sizes, every third upright, each with colors of its own.

    Sizes are 40 to 100 % of the photographs'; colors vary as those of `varied_colors`.
    """
    for index, (path, image) in enumerate(_read(source.photographs)):
        height, width = image.shape[:2]
        upright = round(0.75 * min(height, width)) if index % 3 == 0 else width
        left = round((width - upright) * rng.uniform(0.3, 0.7))
        scale = 0.4 + 0.6 * rng.integers(10) / 9
        view = _varied(image[:, left : left + upright], rng)
        size = (round(scale * upright), round(scale * height))
        _write(folder, path.stem, cv2.resize(view, size, interpolation=cv2.INTER_AREA))


def jpeg_30(source: Source, folder: Path, rng: np.random.Generator) -> None:  # noqa: ARG001
    """JPEG files of quality 30."""
    for path, image in _read(source.photographs):
        _write(folder, path.stem, image, quality=30)


def low_texture(source: Source, folder: Path, rng: np.random.Generator) -> None:
    """Blurred by 0.4 % of the width, a third of the contrast, noise of a dark room."""
    for path, image in _read(source.photographs):
        soft = cv2.GaussianBlur(image, (0, 0), 0.004 * max(image.shape)).astype(np.float32)
        noisy = 128 + (soft - 128) / 3 + rng.normal(0, 2, image.shape)
        _write(folder, path.stem, np.clip(np.rint(noisy), 0, 255).astype(np.uint8))


def foreign(source: Source, folder: Path, rng: np.random.Generator) -> None:
    """Five photographs of another place among them, cropped and scaled to the same size."""
    _copy(source.photographs, folder)
    height, width = read_photograph(source.photographs[0]).shape[:2]
    for index, k in enumerate(sorted(rng.permutation(len(source.elsewhere))[:FOREIGN])):
        image = _filling(read_photograph(source.elsewhere[k]), width, height)
        name = f"{source.photographs[index * 2].stem}_elsewhere"
        cv2.imwrite(str(folder / "images" / f"{name}.png"), image[..., ::-1])


def video(source: Source, folder: Path, rng: np.random.Generator) -> None:
    """A video with shake and a still second after a third of the way; its second half comes first.

    A photograph is one frame, turned by up to a degree and shifted by up to 1.5 % of the width.
    """
    frames = [_shaken(_small(image), rng) for _, image in _read(source.photographs)]
    third, half = len(frames) // 3, len(frames) // 2
    still = [frames[third]] * _FRAMES_A_SECOND
    in_order = [*frames[half:], *frames[:third], *still, *frames[third:half]]
    folder.mkdir(parents=True)
    write_video(folder / "video.mp4", in_order, _FRAMES_A_SECOND)


def given_poses(source: Source, folder: Path, rng: np.random.Generator) -> None:
    """The poses that came with the photographs, to compare with disturbed ones."""
    _write_poses(source, folder, rng, turned_deg=0.0, shifted=0.0)


def disturbed_poses(source: Source, folder: Path, rng: np.random.Generator) -> None:
    """Given poses, turned by 0.5 degrees and shifted by 2 % of the cameras' mean distance."""
    _write_poses(source, folder, rng, turned_deg=0.5, shifted=0.02)


def _write_poses(
    source: Source, folder: Path, rng: np.random.Generator, *, turned_deg: float, shifted: float
) -> None:
    _copy([view.file for view in source.views], folder)
    centers = np.stack([view.world_from_camera[:, 3] for view in source.views])
    shift = shifted * np.linalg.norm(centers - centers.mean(axis=0), axis=1).mean()
    frames = []
    for view in source.views:
        pose = np.vstack([view.world_from_camera, [0.0, 0.0, 0.0, 1.0]])
        turn, _ = cv2.Rodrigues(np.radians(turned_deg) * _direction(rng))
        pose[:3, :3] = turn @ pose[:3, :3]
        pose[:3, 3] += shift * _direction(rng)
        name = f"images/{view.file.name}"
        frames.append({"file_path": name, "transform_matrix": (pose @ _OPENGL).tolist()})
        frames[-1] |= _lens(view)
    (folder / "transforms.json").write_text(json.dumps({"frames": frames}))


MAKERS: dict[str, Maker] = {
    maker.__name__: maker
    for maker in (
        as_they_are, every_fifth, ten, portrait_crops, varied_colors, tourists, jpeg_30,
        low_texture, foreign, video, given_poses, disturbed_poses,
    )
}  # fmt: skip


def photographs_of(folder: Path) -> list[Path]:
    """Returns the photographs of a scene's folder, in natural order."""
    return list_photographs(folder / "images")


def _lens(view: GivenView) -> dict[str, float]:
    """Returns the lens in the words of `transforms.json`."""
    if view.lens.model not in ("PINHOLE", "OPENCV"):
        raise SystemExit(f"poses of {view.lens.model} lenses cannot be disturbed")
    names = ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2")
    intrinsics = dict(zip(names, view.lens.params, strict=False))
    return intrinsics | {"w": view.lens.width, "h": view.lens.height}


def _direction(rng: np.random.Generator) -> np.ndarray:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def _copy(files: Sequence[Path], folder: Path) -> None:
    (folder / "images").mkdir(parents=True)
    for file in files:
        copyfile(file, folder / "images" / file.name)


def _read(files: Sequence[Path]) -> Iterator[tuple[Path, np.ndarray]]:
    for file in files:
        yield file, read_photograph(file)


def _write(folder: Path, name: str, image: np.ndarray, quality: int = JPEG_QUALITY) -> None:
    (folder / "images").mkdir(parents=True, exist_ok=True)
    path = folder / "images" / f"{name}.jpg"
    cv2.imwrite(str(path), image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])


def _varied(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Returns an image with gamma, exposure and white balance changed by up to 20 %."""
    gamma, gains = rng.uniform(0.8, 1.2), rng.uniform(0.8, 1.2, 3)
    varied = np.clip(gains * (image / 255.0) ** gamma, 0, 1)
    return np.asarray(np.rint(255 * varied).astype(np.uint8))


def _filling(image: np.ndarray, width: int, height: int) -> np.ndarray:
    """Returns the middle of an image, as much as fills `width` x `height`."""
    scale = max(width / image.shape[1], height / image.shape[0])
    size = (max(width, round(image.shape[1] * scale)), max(height, round(image.shape[0] * scale)))
    larger = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    top, left = (larger.shape[0] - height) // 2, (larger.shape[1] - width) // 2
    return np.asarray(larger[top : top + height, left : left + width])


def _small(image: np.ndarray) -> np.ndarray:
    scale = min(1.0, _LONGEST_SIDE_OF_VIDEO / max(image.shape))
    size = (round(image.shape[1] * scale), round(image.shape[0] * scale))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))


def _shaken(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    height, width = image.shape[:2]
    turn = cv2.getRotationMatrix2D((width / 2, height / 2), rng.uniform(-1, 1), 1.05)
    turn[:, 2] += rng.uniform(-0.015, 0.015, 2) * width
    return np.asarray(cv2.warpAffine(image, turn, (width, height), borderMode=cv2.BORDER_REFLECT))
