"""Finds the cuts of a clip: between two frames that have less in common than any around them.

A frame after a cut has little in common with the frame before it, while the frames around follow
each other as usual. In a swing, in low light or in a show of slides frames differ as much again and
again, in a fade they differ little by little, and after a flash the old picture comes back.
"""

import numpy as np
from jaxtyping import Bool, Float

from styletrf.capture.clips.frame_flow import FrameFlow

_CUT_CHANGE = 0.1  # of the colors, at least, and
_CUT_CONTRAST = 2.0  # times as much as from frame to frame before and after
_MOSTLY_NEW = 0.5  # more of a picture than is found again
_ODDS = 4.0  # times the odds of new contrast around, and in most frames of the clip
_USUAL = 0.75  # the quantile of the clip
_AROUND_S = 0.1  # and at least one frame

Flags = Bool[np.ndarray, " frames"]
PerFrame = Float[np.ndarray, " frames"]


def cuts(time_s: PerFrame, flow: FrameFlow, lost: Flags, change: PerFrame) -> Flags:
    """Returns which frames are the first after a cut.

    Args:
        time_s: The times of the frames, in seconds.
        flow: The flow from each frame to the next.
        lost: Whether corners of earlier frames were not found again.
        change: The fraction of the colors that changed since the frame before, 0 to 1.
    """
    beside = np.pad(change, 1)
    usual = np.maximum(beside[:-2], beside[2:])
    are_other_colors = lost & (change > _CUT_CHANGE) & (change > _CUT_CONTRAST * usual)
    return np.asarray(are_other_colors | _are_other_pictures(time_s, flow.novelty))


def _are_other_pictures(time_s: PerFrame, novelty: PerFrame) -> Flags:
    """Returns where most of a picture is new, and far more than around and than usually."""
    if len(novelty) < 2:
        return np.zeros(len(novelty), bool)
    fraction = np.clip(novelty, 0.0, 0.99)
    odds = fraction / (1 - fraction)
    usual = float(np.quantile(odds[1:], _USUAL))
    frames = max(1, round(_AROUND_S / max(float(np.median(np.diff(time_s))), 1e-3)))
    around = np.full(len(odds), usual)
    for k in np.flatnonzero(novelty > _MOSTLY_NEW):
        beside = np.append(odds[max(k - frames, 0) : k], odds[k + 1 : k + frames + 1])
        around[k] = max(usual, float(beside.max()))
    return np.asarray((novelty > _MOSTLY_NEW) & (odds > _ODDS * around))
