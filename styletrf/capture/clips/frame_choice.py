"""Chooses frames of videos as photographs: sharp ones, an even parallax apart.

Frames stand at even steps along

    travel = parallax + displacement / 10       in widths of the picture, since the first frame

(see `frame_motion`), so that a walk is taken densely, a turn on the spot just often enough to
overlap, a rest not at all; of the frames about each step the sharpest is taken. Several clips share
the frames by their travel.
"""

import numpy as np
from jaxtyping import Int64

from styletrf.capture.clips.frame_motion import FrameMotion
from styletrf.errors import InputError

_FRACTION_OF_DISPLACEMENT = 0.1
_REACH = 0.35  # of a step, within which a sharper frame is looked for
_LEAST_DISPLACEMENT = 0.02


def chosen_frames(motion: FrameMotion, count: int) -> Int64[np.ndarray, " chosen"]:
    """Returns the ascending indices of at most `count` frames, sharp and an even travel apart.

    Raises:
        InputError: The picture keeps still.
    """
    if len(motion.displacement) == 0 or motion.displacement.max() < _LEAST_DISPLACEMENT:
        raise InputError(
            "the video",
            f"keeps still: its picture moves by less than {_LEAST_DISPLACEMENT:.0%} of its width",
            "Film while walking past or around the scene",
        )
    travel = np.maximum.accumulate(
        motion.parallax + _FRACTION_OF_DISPLACEMENT * motion.displacement
    )
    step = travel[-1] / max(count - 1, 1)
    chosen = set()
    for target in np.linspace(0, travel[-1], count):
        nearby = np.flatnonzero(np.abs(travel - target) <= _REACH * step)
        if len(nearby) == 0:
            nearby = np.abs(travel - target).argmin()[None]
        chosen.add(int(nearby[motion.sharpness[nearby].argmax()]))
    return np.array(sorted(chosen), dtype=np.int64)
