"""Finds when a clip keeps still, and when motion blurs it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int64

from styletrf.capture.clips.frame_motion import FrameMotion, PerFrame

_SHORTEST_REST_S = 0.75
_FEWEST_RESTING = 5  # frames
_REST_EXTENT = 0.06  # of the width at most, in which a hand-held camera rests for long
_REST_SPEED = 0.2  # of the usual speed,
_USUAL_FRACTION = 0.25  # at or below which this fraction of the way is covered
_TREMOR_QUANTILE = 0.75
_TREMOR = 1.5  # times this quantile of the distances from the middle
_ROUNDING_S = 1e-6
_BLURRED = 0.5  # of the sharpness of the frames around
_AROUND_S = 5.0  # before and after
_SHORTEST_BLUR_S = 0.2

Flags = Bool[np.ndarray, " frames"]
Places = Float[np.ndarray, "frames 6"]


@dataclass(frozen=True, slots=True)
class Span:
    """A part of a clip: its frames `first` to `last`, and its times in seconds."""

    start_s: float
    end_s: float
    first: int
    last: int

    def without(self, chosen: Int64[np.ndarray, " chosen"]) -> int:
        """Returns how many of its frames are not among those that are chosen, by their indices."""
        taken = (chosen >= self.first) & (chosen <= self.last)
        return self.last - self.first + 1 - int(taken.sum())


def rests(motion: FrameMotion) -> list[Span]:
    """Returns where the picture keeps still for 0.75 seconds or longer.

    It goes less far than at a fifth of the clip's usual speed, and stays within 6 % of its width,
    which leaves room for the tremor of a hand. The usual speed is that at which, or more slowly,
    the camera goes a quarter of its way: neither rests nor a swing count much.
    """
    spans: list[Span] = []
    places, start = _places(motion), 0
    usual_speed = _usual_speed(motion.time_s, places)
    while start < len(motion.time_s):
        found = _still(motion, places, start, usual_speed)
        if found is not None:
            spans.append(found)
        start = start + 1 if found is None else found.last + 1
    return spans


def blurs(motion: FrameMotion) -> list[Span]:
    """Returns where frames are half as sharp as those around, and the picture moves faster.

    Shorter ones than 0.2 seconds are left out: a sharp frame is near.
    """
    around, interval_s = _sharpness_around(motion), frame_interval_s(motion)
    speed = np.gradient(motion.displacement) if len(around) > 1 else np.zeros_like(around)
    blurred = motion.sharpness < _BLURRED * around
    spans = [
        Span(float(motion.time_s[first]), float(motion.time_s[last]) + interval_s, first, last)
        for first, last in _runs(blurred)
        if speed[first : last + 1].max() > np.median(speed)
    ]
    return [span for span in spans if span.end_s - span.start_s >= _SHORTEST_BLUR_S]


def frame_interval_s(motion: FrameMotion) -> float:
    """Returns the median time from a frame to the next in seconds; 0 for a single frame."""
    return float(np.median(np.diff(motion.time_s))) if len(motion.time_s) > 1 else 0.0


def _places(motion: FrameMotion) -> Places:
    """Returns how far the picture and its halves have moved, in widths, since the first frame.

    A camera that approaches moves the halves apart, and the picture nowhere. Distances are root
    mean squares, since a half is a quarter of the tilt away from the middle.
    """
    flow = motion.flow
    steps = np.column_stack([flow.shift, flow.tilt_down / 4, flow.tilt_right / 4])
    steps[1:][np.diff(motion.shot) > 0] = 0.0
    return np.asarray(np.cumsum(steps, axis=0))


def _still(motion: FrameMotion, places: Places, start: int, usual_speed: float) -> Span | None:
    """Returns the rest that begins at a frame, without frames at its ends that still move."""
    count = _still_frames(motion, places, start, usual_speed)
    half_step = usual_speed * frame_interval_s(motion) / 2
    near = _near_the_middle(places[start : start + count], half_step)
    first, last = start + int(near[0]), start + int(near[-1])
    span = Span(float(motion.time_s[first]), float(motion.time_s[last]), first, last)
    is_long = span.end_s - span.start_s >= _SHORTEST_REST_S - _ROUNDING_S
    return span if is_long and last - first + 1 >= _FEWEST_RESTING else None


def _still_frames(motion: FrameMotion, places: Places, start: int, usual_speed: float) -> int:
    """Returns how many frames from one on keep to an extent that grows with their time."""
    end = int(np.searchsorted(motion.shot, motion.shot[start], side="right"))
    lasting_s = motion.time_s[start:end] - motion.time_s[start]
    allowed = _REST_SPEED * usual_speed * np.maximum(lasting_s, _SHORTEST_REST_S)
    allowed = np.minimum(allowed, _REST_EXTENT)
    soon = 1 + int(np.searchsorted(lasting_s, _SHORTEST_REST_S))
    for count in (soon, end - start):  # the few frames first, since most stretches end there
        extent = _extents(places[start:end][:count])
        leaves = extent > allowed[: len(extent)]
        if leaves.any():
            return int(leaves.argmax())
    return end - start


def _extents(places: Places) -> PerFrame:
    """Returns the diagonal of the box of the places up to each."""
    most, least = (f.accumulate(places, axis=0) for f in (np.maximum, np.minimum))
    return np.asarray(np.linalg.norm(most - least, axis=1))


def _near_the_middle(places: Places, half_step: float) -> Int64[np.ndarray, " near"]:
    """Returns which places are no further from the middle one than tremor, or half a usual step."""
    away = np.linalg.norm(places - np.median(places, axis=0), axis=1)
    tremor = _TREMOR * float(np.quantile(away, _TREMOR_QUANTILE))
    return np.flatnonzero(away <= max(tremor, half_step, float(away.min())))


def _usual_speed(time_s: PerFrame, places: Places) -> float:
    """Returns the speed in widths a second at or below which a quarter of the way is covered."""
    ends = np.searchsorted(time_s, time_s + (_SHORTEST_REST_S - _ROUNDING_S))
    starts = np.flatnonzero(ends < len(time_s))
    ways = np.sort(np.linalg.norm(places[ends[starts]] - places[starts], axis=1))
    gone = np.cumsum(ways)
    if len(ways) == 0 or gone[-1] == 0:
        return 0.0
    return float(ways[np.searchsorted(gone, _USUAL_FRACTION * gone[-1])]) / _SHORTEST_REST_S


def _sharpness_around(motion: FrameMotion) -> PerFrame:
    """Returns, for each frame, the median sharpness of its shot within five seconds of it."""
    medians = np.empty_like(motion.sharpness)
    for k, (time_s, shot) in enumerate(zip(motion.time_s, motion.shot, strict=True)):
        near = (np.abs(motion.time_s - time_s) <= _AROUND_S) & (motion.shot == shot)
        medians[k] = np.median(motion.sharpness[near])
    return medians


def _runs(flags: Flags) -> Sequence[tuple[int, int]]:
    """Returns the first and last index of each run of true flags."""
    steps = np.diff(np.pad(flags.astype(int), 1))
    starts, ends = np.flatnonzero(steps > 0), np.flatnonzero(steps < 0) - 1
    return list(zip(starts.tolist(), ends.tolist(), strict=True))
