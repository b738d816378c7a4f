"""Warnings about a clip: where it is cut, rests, is blurred, leans or breaks off."""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Int64

from styletrf.capture.clips.frame_motion import FrameMotion
from styletrf.capture.clips.rolling_shutter import rolling_shutter
from styletrf.capture.clips.spans import Span, blurs, frame_interval_s, rests

_LEAST_SHARPNESS = 0.01  # of a median frame: photographs have 0.07 to 0.7, blurred by 1/480 less
_MISSING_S = 0.5  # of the duration that the file declares
_TIMES_NAMED = 5

Chosen = Int64[np.ndarray, " chosen"]


def clip_warnings(
    name: str, motion: FrameMotion, declared_s: float | None, chosen: Chosen
) -> Iterator[str]:
    """Yields a line for each thing that is odd about a clip.

    Args:
        name: The name of the clip.
        motion: The measures of its frames, at least one.
        declared_s: How long the file says that the clip lasts.
        chosen: The indices of the frames that are taken.
    """
    end_s = float(motion.time_s[-1]) + frame_interval_s(motion)
    if declared_s is not None and declared_s - end_s > _MISSING_S:
        yield (
            f"{name} breaks off at {end_s:.1f} s of {declared_s:.1f} s: the file is cut short or"
            " damaged, and what can be read is used"
        )
    if times := _listed([f"{cut_s:.1f} s" for cut_s in motion.cuts_s]):
        cuts = "a cut" if len(motion.cuts_s) == 1 else "cuts"
        yield f"{name} has {cuts} at {times}: what lies before and after are sequences of their own"
    still = [f"{_described(span)} ({_left_out(span, chosen)})" for span in rests(motion)]
    if times := _listed(still):
        yield f"{name} keeps still at {times}: a rest shows nothing new"
    yield from _warnings_of_motion(name, motion)


def _warnings_of_motion(name: str, motion: FrameMotion) -> Iterator[str]:
    """Yields the defects that the camera's motion causes, and how to film better."""
    if times := _listed([_described(span) for span in blurs(motion)]):
        yield (
            f"{name} is blurred by motion at {times}: move more slowly, use more light or a"
            " shorter exposure"
        )
    if shutter := rolling_shutter(motion):
        yield (
            f"{name} leans where the camera moves (a rolling shutter, which takes"
            f" {shutter.fraction:.0%} of the time between frames from one side to the other):"
            f" a quarter of its frames by {shutter.lean:.1%} of their width or more; move more"
            " slowly and steadily, since light and exposure change blur only"
        )
    if motion.displacement[-1] > 0 and not motion.has_parallax:
        fraction = motion.parallax[-1] / motion.displacement[-1]
        yield (
            f"{name} hardly has parallax ({fraction:.1%} of its motion): a camera that turns on the"
            " spot sees no depth; film while walking past or around the scene"
        )
    if float(np.median(motion.sharpness)) < _LEAST_SHARPNESS:
        yield f"{name} is blurred throughout: hold the camera steadier, or use more light"


def _described(span: Span) -> str:
    """Returns when a part of a clip begins and ends."""
    return f"{span.start_s:.1f} to {span.end_s:.1f} s"


def _left_out(span: Span, chosen: Chosen) -> str:
    """Returns how many frames of a part are not taken."""
    count = span.without(chosen)
    return f"{count} {'frame' if count == 1 else 'frames'} left out"


def _listed(times: Sequence[str]) -> str:
    more = len(times) - _TIMES_NAMED
    return ", ".join(times[:_TIMES_NAMED]) + (f" and {more} more times" if more > 0 else "")
