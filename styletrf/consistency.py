"""How steady a stylised trajectory is: StyleTRF (Goel et al. 2022), section 6.2.

A low error alone proves little: a grey video has none, and the flow itself is imperfect. So the
same error of the unstylised frames (the floor) and the error where the flow can be trusted stand
beside it.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from styletrf.errors import InputError
from styletrf.float_images import read_float_image
from styletrf.flow import agreement, optical_flow, warp_to_a
from styletrf.images import read_rgb
from styletrf.metrics import mean_squared_error
from styletrf.progress import Progress, silent

Image = Float[np.ndarray, "_ _ 3"]  # sizes are checked with a message
SHORT_TERM, LONG_TERM = 1, 5


@dataclass(frozen=True, slots=True)
class ConsistencyConfig:
    """Which frames are compared, and along which flow (see `styletrf.flow`)."""

    method: str = "dis"
    deltas: tuple[int, ...] = (SHORT_TERM, LONG_TERM)


@dataclass(frozen=True, slots=True)
class ConsistencyPair:
    """Two frames compared in the first one's view; errors are mean squares on [0, 1].

    Attributes:
        first: Index of the frame compared in.
        second: Index of the frame warped, `first + delta`.
        delta: Frames between the two.
        error: Of the stylised frames, over all pixels: the paper's figure.
        floor: The same of the unstylised frames.
        valid_fraction: Of the pixels, those that return to themselves by way of the other frame.
        masked_error: `error` over the valid pixels; NaN where there are none.
        masked_floor: `floor` over the valid pixels; NaN where there are none.
    """

    first: int
    second: int
    delta: int
    error: float
    floor: float
    valid_fraction: float
    masked_error: float
    masked_floor: float


@dataclass(frozen=True, slots=True)
class Consistency:
    """All pairs, and their means: `summary["delta_1"]["error"]` is the paper's short term error.

    Each entry of the summary has `pairs` (their number) and the means of the columns of
    `ConsistencyPair`, null where there is nothing to average.
    """

    pairs: list[ConsistencyPair]
    summary: dict[str, dict[str, int | float | None]]


def measure_consistency(
    unstylized: Sequence[Image | Path],
    stylized: Sequence[Image | Path],
    deltas: Sequence[int] = (SHORT_TERM, LONG_TERM),
    method: str = "dis",
    progress: Progress = silent,
) -> Consistency:
    """Returns the consistency of `stylized`, along the flow of `unstylized`, for every pair.

    For frames i and j = i + delta with the flow w from unstylised i to unstylised j, the error is
    the mean over pixels p and channels of (S_i(p) - S_j(p + w(p)))^2. Pixels that leave the image
    take its nearest border pixel. Frames given as paths (PNG, OpenEXR) are read when their turn
    comes; at most `max(deltas) + 1` of each kind are in memory.

    Raises:
        InputError: The two sequences differ in length, their frames in size, or there are too few
            frames for any of the deltas.
    """
    _check_lengths(len(unstylized), len(stylized), deltas)
    total = sum(max(0, len(stylized) - delta) for delta in deltas)
    pairs: list[ConsistencyPair] = []
    for first, second, frames in _frame_pairs(unstylized, stylized, deltas):
        pairs.append(_compare(first, second, frames, method))
        mean = sum(pair.error for pair in pairs) / len(pairs)
        progress(len(pairs), total, consistency_error=mean)
    pairs.sort(key=lambda pair: (pair.delta, pair.first))
    return Consistency(pairs, {f"delta_{delta}": _summary(pairs, delta) for delta in deltas})


@dataclass(frozen=True, slots=True)
class _Frame:
    unstylized: Image
    stylized: Image


def _frame_pairs(
    unstylized: Sequence[Image | Path], stylized: Sequence[Image | Path], deltas: Sequence[int]
) -> Iterator[tuple[int, int, tuple[_Frame, _Frame]]]:
    window: dict[int, _Frame] = {}
    for second, (plain, painted) in enumerate(zip(unstylized, stylized, strict=True)):
        window[second] = _Frame(_loaded(plain), _loaded(painted))
        _check_sizes(second, window[second], window[max(0, second - 1)])
        for delta in deltas:
            if second >= delta:
                first = second - delta
                yield first, second, (window[first], window[second])
        window.pop(second - max(deltas), None)


def _loaded(frame: Image | Path) -> Image:
    if not isinstance(frame, Path):
        return frame
    return read_float_image(frame).color if frame.suffix == ".exr" else read_rgb(frame)


def _compare(
    first: int, second: int, frames: tuple[_Frame, _Frame], method: str
) -> ConsistencyPair:
    a, b = frames
    there = optical_flow(a.unstylized, b.unstylized, method)
    back = optical_flow(b.unstylized, a.unstylized, method)
    valid = agreement(there, back)
    stylized, _ = warp_to_a(b.stylized, there)
    unstylized, _ = warp_to_a(b.unstylized, there)
    return ConsistencyPair(
        first=first,
        second=second,
        delta=second - first,
        error=mean_squared_error(stylized, a.stylized),
        floor=mean_squared_error(unstylized, a.unstylized),
        valid_fraction=float(valid.mean()),
        masked_error=mean_squared_error(stylized, a.stylized, valid),
        masked_floor=mean_squared_error(unstylized, a.unstylized, valid),
    )


def _summary(pairs: Sequence[ConsistencyPair], delta: int) -> dict[str, int | float | None]:
    chosen = [pair for pair in pairs if pair.delta == delta]
    return {
        "pairs": len(chosen),
        "error": _mean([pair.error for pair in chosen]),
        "floor": _mean([pair.floor for pair in chosen]),
        "valid_fraction": _mean([pair.valid_fraction for pair in chosen]),
        "masked_error": _mean([pair.masked_error for pair in chosen]),
        "masked_floor": _mean([pair.masked_floor for pair in chosen]),
    }


def _mean(values: Sequence[float]) -> float | None:
    defined = [value for value in values if not math.isnan(value)]
    return sum(defined) / len(defined) if defined else None


def _check_lengths(unstylized: int, stylized: int, deltas: Sequence[int]) -> None:
    if unstylized != stylized:
        raise InputError(
            "trajectory",
            f"has {unstylized} unstylised and {stylized} stylised frames",
            "Render both along the same trajectory",
        )
    if not deltas or min(deltas) < 1 or stylized <= min(deltas):
        raise InputError(
            f"trajectory of {stylized} frames",
            f"has no pair of frames {' or '.join(map(str, deltas))} apart",
            "Render more frames, or measure smaller distances, from 1",
        )


def _check_sizes(index: int, frame: _Frame, before: _Frame) -> None:
    sizes = {image.shape[:2] for image in (frame.unstylized, frame.stylized, before.stylized)}
    if len(sizes) > 1:
        listed = " and ".join(f"{width}x{height}" for height, width in sorted(sizes))
        raise InputError(
            f"frame {index}", f"mixes sizes of {listed} pixels", "Render all frames at one size"
        )
