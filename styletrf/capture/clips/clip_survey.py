"""What a person should know of a clip: where it is cut, rests, is blurred or breaks off."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from styletrf.capture.clips.frame_motion import FrameMotion, PerFrame

_LEAST_SHARPNESS = 0.01  # of a median frame: photographs have 0.07 to 0.7, blurred by 1/480 less
_REST_MOTION = 0.03  # of the width, within which a hand-held camera rests
_SHORTEST_REST_S = 3.0
_BLURRED = 0.5  # of the sharpness of the frames around
_AROUND_S = 5.0  # before and after
_SHORTEST_BLUR_S = 0.2
_MISSING_S = 0.5  # of what the file declares
_SPANS_NAMED = 5


@dataclass(frozen=True, slots=True)
class Span:
    """A part of a clip, in seconds since its first frame."""

    start_s: float
    end_s: float


def clip_warnings(name: str, motion: FrameMotion, declared_s: float | None) -> Iterator[str]:
    """Yields a line for each thing that is odd about a clip.

    Args:
        name: Of the clip.
        motion: What its frames show, of at least one.
        declared_s: How long the file says that the clip lasts.
    """
    end_s = float(motion.time_s[-1]) + _interval_s(motion)
    if declared_s is not None and declared_s - end_s > _MISSING_S:
        yield (
            f"{name} breaks off at {end_s:.1f} s of {declared_s:.1f} s: the file is cut short or"
            " damaged, and what can be read is used"
        )
    for cut_s in motion.cuts_s:
        yield f"{name} has a cut at {cut_s:.1f} s: what lies before and after are two sequences"
    if times := _listed(rests(motion)):
        yield f"{name} keeps still at {times}: no more than one frame of each rest is taken"
    if times := _listed(blurs(motion)):
        yield f"{name} is blurred by motion at {times}: move more slowly, or use more light"
    if motion.displacement[-1] > 0 and not motion.has_parallax:
        share = motion.parallax[-1] / motion.displacement[-1]
        yield (
            f"{name} hardly has parallax ({share:.1%} of its motion): a camera that turns on the"
            " spot sees no depth; film while walking past or around the scene"
        )
    if float(np.median(motion.sharpness)) < _LEAST_SHARPNESS:
        yield f"{name} is blurred throughout: hold the camera steadier, or use more light"


def rests(motion: FrameMotion) -> list[Span]:
    """Returns where the picture stays within 3 % of its width for 3 seconds or longer."""
    spans, start = [], 0
    while start < len(motion.time_s):
        away = np.abs(motion.displacement[start:] - motion.displacement[start])
        leaves = (away > _REST_MOTION) | (motion.shot[start:] != motion.shot[start])
        count = int(leaves.argmax()) if leaves.any() else len(away)
        span = Span(float(motion.time_s[start]), float(motion.time_s[start + count - 1]))
        is_rest = span.end_s - span.start_s >= _SHORTEST_REST_S
        if is_rest:
            spans.append(span)
        start += count if is_rest else 1
    return spans


def blurs(motion: FrameMotion) -> list[Span]:
    """Returns where frames are half as sharp as those around, and the picture moves faster.

    Shorter ones than 0.2 seconds are left out: a sharp frame is near.
    """
    around, interval_s = _sharpness_around(motion), _interval_s(motion)
    speed = np.gradient(motion.displacement) if len(around) > 1 else np.zeros_like(around)
    blurred = motion.sharpness < _BLURRED * around
    spans = [
        Span(float(motion.time_s[first]), float(motion.time_s[last]) + interval_s)
        for first, last in _runs(blurred)
        if speed[first : last + 1].max() > np.median(speed)
    ]
    return [span for span in spans if span.end_s - span.start_s >= _SHORTEST_BLUR_S]


def _sharpness_around(motion: FrameMotion) -> PerFrame:
    """Returns, for each frame, the median sharpness of its shot within five seconds of it."""
    medians = np.empty_like(motion.sharpness)
    for k, (time_s, shot) in enumerate(zip(motion.time_s, motion.shot, strict=True)):
        near = (np.abs(motion.time_s - time_s) <= _AROUND_S) & (motion.shot == shot)
        medians[k] = np.median(motion.sharpness[near])
    return medians


def _runs(flags: Bool[np.ndarray, " frames"]) -> list[tuple[int, int]]:
    """Returns the first and last index of each run of true flags."""
    steps = np.diff(np.pad(flags.astype(int), 1))
    starts, ends = np.flatnonzero(steps > 0), np.flatnonzero(steps < 0) - 1
    return list(zip(starts.tolist(), ends.tolist(), strict=True))


def _interval_s(motion: FrameMotion) -> float:
    return float(np.median(np.diff(motion.time_s))) if len(motion.time_s) > 1 else 0.0


def _listed(spans: list[Span]) -> str:
    times = [f"{span.start_s:.1f} to {span.end_s:.1f} s" for span in spans[:_SPANS_NAMED]]
    more = len(spans) - _SPANS_NAMED
    return ", ".join(times) + (f" and {more} more times" if more > 0 else "")
