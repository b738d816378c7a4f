"""Measures how the picture of a clip changes from each frame to the next.

The dense flow (Kroeger et al. 2016) between small pictures shows how they move, how their halves
move against each other, and which part of a picture the one before does not show.
"""

from dataclasses import dataclass, fields

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from styletrf.geometry.image_sampling import sample_at

_SIDE = 160  # of the small pictures, in pixels
_GRID = 4  # every fourth pixel of them counts
_AROUND = 15  # pixels, whose mean and deviation are the local brightness and contrast
_SMALLEST_SIDE = 32  # of a picture; below, DIS crashes on those of 160 pixels
_LEAST_CONTRAST = 1.0  # of 255, of a picture
_NOISE = 4.0  # of 255, far below which contrast does not count

Gray = UInt8[np.ndarray, "height width"]
PerFrame = Float[np.ndarray, " frames"]


@dataclass(frozen=True, slots=True)
class FrameFlow:
    """The new part and the motion of each frame since the frame before; 0 for the first frame.

    `novelty` is 1 minus the correlation of local contrasts once the flow is undone: about 0.05 from
    frame to frame, 1 where nothing is found again, whatever the light. `shift` is the motion (right
    and down), `tilt_down` how much more the bottom moves than the top, `tilt_right` the right than
    the left, all in widths of the picture.
    """

    novelty: PerFrame
    shift: Float[np.ndarray, "frames 2"]
    tilt_down: Float[np.ndarray, "frames 2"]
    tilt_right: Float[np.ndarray, "frames 2"]

    def then(self, other: "FrameFlow") -> "FrameFlow":
        """Returns the flow of two clips one after another."""
        names = [field.name for field in fields(self)]
        pairs = [(getattr(self, name), getattr(other, name)) for name in names]
        return FrameFlow(*[np.concatenate(pair) for pair in pairs])


def flow_of(rows: Float[np.ndarray, "frames 7"]) -> FrameFlow:
    """Returns the flow of a clip from the `flow_between` its frames; zeros for the first."""
    return FrameFlow(rows[:, 0], rows[:, 1:3], rows[:, 3:5], rows[:, 5:7])


def small_picture(gray: Gray) -> UInt8[np.ndarray, "_ _"]:
    """Returns a picture whose longer side has at most 160 pixels."""
    scale = min(1.0, _SIDE / max(gray.shape))
    height, width = (max(1, round(scale * side)) for side in gray.shape)
    return np.asarray(cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA))


def flow_between(before: Gray, after: Gray) -> Float[np.ndarray, "7"]:
    """Returns the novelty, shift, tilt down and tilt right of a small picture since another.

    Returns zeros where either picture is too small for flow or has no contrast.
    """
    deviations = [float(cv2.meanStdDev(gray)[1].item()) for gray in (before, after)]
    if min(before.shape) < _SMALLEST_SIDE or min(deviations) < _LEAST_CONTRAST:
        return np.zeros(7)
    finder = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
    flow = finder.calc(before, after, np.zeros((*before.shape, 2), np.float32))
    novelty = 1.0 - _correlation(_contrasts(before), _contrasts(_undone(after, flow)))
    return np.concatenate([[novelty], *_motions(flow[::_GRID, ::_GRID] / before.shape[1])])


def _motions(flow: Float[np.ndarray, "rows columns 2"]) -> list[Float[np.ndarray, "2"]]:
    """Returns shift, tilt down and tilt right from the medians of halves, half a side apart."""
    row, column = flow.shape[0] // 2, flow.shape[1] // 2
    halves = flow[:row], flow[row:], flow[:, :column], flow[:, column:]
    top, bottom, left, right = (np.median(half, axis=(0, 1)) for half in halves)
    return [(top + bottom) / 2, 2 * (bottom - top), 2 * (right - left)]


def _undone(after: Gray, flow: Float[np.ndarray, "height width 2"]) -> Gray:
    """Returns the later picture where the earlier one has the same."""
    rows, columns = np.indices(after.shape, dtype=np.float32)
    return sample_at(after, flow + np.stack([columns, rows], axis=-1))


def _contrasts(gray: Gray) -> Float[np.ndarray, "height width"]:
    """Returns how far pixels are from the mean around them, in deviations around them."""
    around = (_AROUND, _AROUND)
    above = gray - cv2.blur(gray.astype(np.float32), around)
    return np.asarray(above / (np.sqrt(cv2.blur(above * above, around)) + _NOISE))


def _correlation(
    one: Float[np.ndarray, "height width"], other: Float[np.ndarray, "height width"]
) -> float:
    """Returns the correlation of two pictures whose mean is 0; 1 where one is flat."""
    power = float((one * one).sum()) * float((other * other).sum())
    return float((one * other).sum()) / power**0.5 if power > 0 else 1.0
