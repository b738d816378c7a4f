"""The photographs as COLMAP is given them: upright PNGs of one size, named by their position."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from jaxtyping import UInt8

from styletrf.colmap import pycolmap
from styletrf.photographs import read_photograph
from styletrf.progress import Progress
from styletrf.scene_capture import Capture

Lenses = Literal["auto", "one", "each"]
_ONE_SETTING = 1.03  # ratio of focal lengths, up to which they are one


@dataclass(frozen=True, slots=True)
class ColmapImages:
    """A folder of PNGs of `width` x `height`, and by which lens setting each was taken."""

    folder: Path
    files: tuple[str, ...]
    width: int
    height: int
    lenses: tuple["LensSetting", ...]


@dataclass(frozen=True, slots=True)
class LensSetting:
    """Photographs taken with one focal length, which is known or not."""

    files: tuple[str, ...]
    focal_prior_px: float | None


def prepare_images(
    capture_dir: Path,
    capture: Capture,
    folder: Path,
    max_long_side: int,
    lenses: Lenses,
    progress: Progress,
) -> ColmapImages:
    """Writes the photographs of a capture into `folder`, upright and at most so large.

    With `auto` lenses, photographs whose EXIF tells focal lengths more than 3 % apart were taken
    with several lens settings; those that tell none are of the commonest.
    """
    folder.mkdir(parents=True)
    first, total = capture.photographs[0], len(capture.photographs)
    scale = min(1.0, max_long_side / max(first.width, first.height))
    width, height = max(1, round(first.width * scale)), max(1, round(first.height * scale))
    files = tuple(f"{index:06d}.png" for index in range(total))
    for index, (photograph, file) in enumerate(zip(capture.photographs, files, strict=True)):
        progress(index, total)
        image = read_photograph(capture_dir / "images" / photograph.file)
        if scale < 1:
            image = np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA))
        write_png(folder / file, image, compression=1)
    progress(total, total)
    focals_px = [
        _focal_told(capture_dir / "images" / photograph.file, max(width, height))
        for photograph in capture.photographs
    ]
    return ColmapImages(folder, files, width, height, lens_settings(files, focals_px, lenses))


def lens_settings(
    files: Sequence[str], focals_px: Sequence[float | None], lenses: Lenses
) -> tuple[LensSetting, ...]:
    """Returns which photographs share a lens setting, and each setting's median focal length."""
    if lenses == "each":
        groups = [[k] for k in range(len(files))]
    else:
        told = sorted((f, k) for k, f in enumerate(focals_px) if f is not None)
        groups = [[k for _, k in run] for run in _runs(told)] if lenses == "auto" else []
        groups = groups if len(groups) > 1 else [[k for _, k in told]]
        commonest = max(groups, key=len)
        commonest += [k for k, f in enumerate(focals_px) if f is None]
    return tuple(
        LensSetting(
            tuple(files[k] for k in sorted(group)),
            _median([f for k in group if (f := focals_px[k]) is not None]),
        )
        for group in sorted(groups, key=min)
    )


def _runs(told: Sequence[tuple[float, int]]) -> list[list[tuple[float, int]]]:
    """Returns ascending focal lengths cut where one is more than 3 % above the last."""
    runs: list[list[tuple[float, int]]] = []
    for focal, k in told:
        if not runs or focal > _ONE_SETTING * runs[-1][-1][0]:
            runs.append([])
        runs[-1].append((focal, k))
    return runs


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None


def _focal_told(path: Path, long_side: int) -> float | None:
    """Returns the focal length that EXIF tells, in pixels of an image so large.

    It is asked of the user's own files: the upright copies carry none.
    """
    with suppress(ValueError):  # COLMAP reads fewer formats than OpenCV, and need not here
        lens = pycolmap.infer_camera_from_image(path)
        if lens.has_prior_focal_length:
            return float(lens.mean_focal_length() * long_side / max(lens.width, lens.height))
    return None


def write_png(path: Path, image: UInt8[np.ndarray, "height width 3"], compression: int) -> None:
    """Writes an RGB image; zlib's `compression` from 0 to 9. The same image, the same bytes."""
    bgr = np.ascontiguousarray(image[..., ::-1])
    _, encoded = cv2.imencode(".png", bgr, [cv2.IMWRITE_PNG_COMPRESSION, compression])
    path.write_bytes(encoded.tobytes())
