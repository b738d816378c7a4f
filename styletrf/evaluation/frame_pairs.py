"""Pairs of frames along a trajectory, each frame read once and kept no longer than it is needed."""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from styletrf.errors import InputError
from styletrf.evaluation.metrics import Image
from styletrf.files.float_images import FloatImage, read_float_image
from styletrf.files.images import read_rgb
from styletrf.finiteness import require_finite
from styletrf.geometry.cameras import Camera


@dataclass(frozen=True, slots=True)
class Frame:
    """One view of the trajectory, without and with style."""

    camera: Camera
    unstylized: FloatImage
    stylized: Image


@dataclass(frozen=True, slots=True)
class Pair:
    """Two frames by their indices, and by what they are compared beside the depth."""

    first: int
    second: int
    delta: int
    has_flow: bool
    has_looks: bool


def read_frame(unstylized: Path, stylized: Path, camera: Camera) -> Frame:
    """Returns the frame `frames/NAME.exr` and `frames/NAME.png` of two folders."""
    plain = read_float_image(unstylized / "frames" / f"{camera.name}.exr")
    return Frame(camera, plain, read_rgb(stylized / "frames" / f"{camera.name}.png"))


def paired(
    frames: Iterable[Frame], planned: Collection[Pair]
) -> Iterator[tuple[Pair, Frame, Frame]]:
    """Yields the pairs with their frames, of which no more are kept than are still needed."""
    window: dict[int, Frame] = {}
    first = None
    for index, frame in enumerate(frames):
        first = first or frame
        _require_one_size(index, frame, first)
        images = [("unstylised", frame.unstylized.color), ("stylised", frame.stylized)]
        require_finite("consistency", f"in frame {frame.camera.name}", images)
        window[index] = frame
        for pair in (pair for pair in planned if pair.second == index):
            yield pair, window[pair.first], frame
        needed = {pair.first for pair in planned if pair.second > index}
        window = {k: kept for k, kept in window.items() if k in needed}


def _require_one_size(index: int, frame: Frame, before: Frame) -> None:
    images = frame.unstylized.color, frame.stylized, before.stylized
    sizes = {image.shape[:2] for image in images}
    if len(sizes) > 1:
        listed = " and ".join(f"{width}x{height}" for height, width in sorted(sizes))
        raise InputError(
            f"frame {index}", f"mixes sizes of {listed} pixels", "Render all frames at one size"
        )
