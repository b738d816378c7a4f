"""Pairs of frames along a trajectory, each frame read once and kept no longer than it is needed."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from styletrf.errors import InputError
from styletrf.evaluation.consistency.pair_plan import PairPlan
from styletrf.evaluation.metrics import Image
from styletrf.even_spread import evenly_spread
from styletrf.files.float_images import FloatImage, read_float_image
from styletrf.files.images import read_rgb
from styletrf.finiteness import require_finite
from styletrf.geometry.cameras import Camera

Depth = Float[np.ndarray, "height width"]

OWN_DEPTHS = "own_depths"


@dataclass(frozen=True, slots=True)
class Frame:
    """One view of the trajectory, without and with style.

    `own_depth` is that of the stylized field, where its density is not that of the unstylized one.
    """

    camera: Camera
    unstylized: FloatImage
    stylized: Image
    own_depth: Depth | None = None


@dataclass(frozen=True, slots=True)
class Pair:
    """Two frames by their indices, and the measures by which they are compared beside the depth."""

    first: int
    second: int
    delta: int
    has_flow: bool
    has_looks: bool


def planned_pairs(n_frames: int, plan: PairPlan, cuts: Sequence[int] = ()) -> list[Pair]:
    """Returns the pairs to compare, in the order of their second frames.

    Of each delta `plan.pairs`, spread evenly from the first to the last frame, or all; of these
    in turn `plan.perceptual_pairs` go through the perceptual network. Frames before and after
    one of the `cuts`, at which another still begins, are no pair.
    """
    planned = []
    for delta in {*plan.deltas, *plan.depth_deltas}:
        has_flow = delta in plan.deltas
        within = [
            k for k in range(n_frames - delta) if not any(k < cut <= k + delta for cut in cuts)
        ]
        firsts = evenly_spread(within, plan.pairs)
        looked_at = evenly_spread(firsts, plan.perceptual_pairs) if has_flow else []
        planned += [Pair(k, k + delta, delta, has_flow, k in looked_at) for k in firsts]
    return sorted(planned, key=lambda pair: (pair.second, pair.delta))


def read_frame(unstylized: Path, stylized: Path, camera: Camera) -> Frame:
    """Returns `frames/NAME.exr` and `frames/NAME.png` of two folders.

    Beside them the depth of `own_depths/NAME.exr`, where the second folder has one.
    """
    plain = read_float_image(unstylized / "frames" / f"{camera.name}.exr")
    own = stylized / OWN_DEPTHS / f"{camera.name}.exr"
    own_depth = read_float_image(own).depth if own.exists() else None
    return Frame(camera, plain, read_rgb(stylized / "frames" / f"{camera.name}.png"), own_depth)


def paired(
    frames: Iterable[Frame], planned: Collection[Pair]
) -> Iterator[tuple[Pair, Frame, Frame]]:
    """Yields the pairs with their frames, of which no more are kept than are still needed."""
    window: dict[int, Frame] = {}
    first = None
    for index, frame in enumerate(frames):
        first = first or frame
        _require_one_size(index, frame, first)
        images = [("unstylized", frame.unstylized.color), ("stylized", frame.stylized)]
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
