"""Detects a rolling shutter: the rows of a picture are exposed one after another.

Let d(t) be how far the picture moves from a time t to one frame later. A shutter that needs the
fraction r of the time between frames from the first row to the last shows, in frame k,

    bottom moves more than top by   d(k + r) - d(k) = r d'(k)

so that the halves of a picture move apart where the motion changes, and only there: a pan at a
constant speed leans, but leans alike in all frames. Scenes of depth, rolls and approaches move the
halves apart, too, but in proportion to other things, which a regression takes out.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from styletrf.capture.clips.frame_motion import FrameMotion

_FEWEST = 24  # frames
_LEAST_CORRELATION = 0.5
_LEAST_SIGNIFICANCE = 6.0  # deviations from no correlation
_LEAST_LEAN = 0.0025  # of the width: 4 of 1600 pixels, within which the mapper takes matches
_LEANING_QUANTILE = 0.75
_MOSTLY_NEW = 0.5  # of a picture, whose flow says nothing

Flags = Bool[np.ndarray, " frames"]
Series = Float[np.ndarray, " frames"]
Pairs = Float[np.ndarray, "frames 2"]


@dataclass(frozen=True, slots=True)
class RollingShutter:
    """The lean of a clip's frames whose rows (or columns) are exposed one after another.

    `fraction` is the readout time of a frame over the interval between frames. `lean` is the upper
    quartile of the frames' leans, in widths of the picture. `correlation`, 0 to 1, says how well
    the change of the motion explains that the halves move apart.
    """

    fraction: float
    lean: float
    correlation: float


def rolling_shutter(motion: FrameMotion) -> RollingShutter | None:
    """Returns how frames lean, if they clearly do by more than the mapper tolerates; else None."""
    flow = motion.flow
    leaning = [
        found
        for tilt, other in ((flow.tilt_down, flow.tilt_right), (flow.tilt_right, flow.tilt_down))
        if (found := _along(motion, tilt, other)) is not None
    ]
    return max(leaning, key=lambda found: found.correlation, default=None)


def _along(motion: FrameMotion, tilt: Pairs, other: Pairs) -> RollingShutter | None:
    """Returns the shutter that `tilt` shows along its direction; `other` is across."""
    used, shift = _followed(motion), motion.flow.shift
    change = np.gradient(shift, axis=0) if len(shift) > 1 else np.zeros_like(shift)
    if used.sum() < _FEWEST:
        return None
    apart, sources = [], []
    for k in range(2):  # a roll or an approach moves the other halves the other way
        known = np.column_stack([np.ones(len(shift)), shift, other[:, 1 - k]])[used]
        apart.append(_unexplained(tilt[used, k], known))
        sources.append(_unexplained(change[used, k], known))
    fraction, correlation = _regression(np.concatenate(sources), np.concatenate(apart))
    freedom = 2 * float(used.sum()) - 8 - 2
    deviations = correlation * (freedom / max(1 - correlation**2, 1e-9)) ** 0.5
    leans = abs(fraction) * np.linalg.norm(shift[used], axis=1)
    lean = float(np.quantile(leans, _LEANING_QUANTILE))
    is_clear = correlation > _LEAST_CORRELATION and deviations > _LEAST_SIGNIFICANCE
    if not is_clear or lean < _LEAST_LEAN:
        return None
    return RollingShutter(abs(fraction), lean, correlation)


def _followed(motion: FrameMotion) -> Flags:
    """Returns which frames are followed from the one before to the next, within one shot."""
    known = motion.flow.novelty < _MOSTLY_NEW
    known[1:] &= np.diff(motion.shot) == 0
    known[:1] = False
    return np.asarray(known & np.append(False, known[:-1]) & np.append(known[1:], False))


def _unexplained(values: Series, known: Float[np.ndarray, "frames regressors"]) -> Series:
    """Returns the residuals of the values after a linear regression."""
    return np.asarray(values - known @ np.linalg.lstsq(known, values, rcond=None)[0])


def _regression(source: Series, values: Series) -> tuple[float, float]:
    """Returns the slope of values over their source, and the correlation without its sign."""
    power, product = float(source @ source), float(source @ values)
    if power == 0 or not values.any():
        return 0.0, 0.0
    return product / power, abs(product) / (power * float(values @ values)) ** 0.5
