"""Measures the frames of a video: how sharp each is, how the camera moved, and where it was cut.

From a frame on some corners are followed (Lucas and Kanade 1981), there and back, until the picture
has moved by 3 % of its width, then others from there. Their displacement shows how the picture
moved; the part of it that no homography explains is parallax, of which a turning or resting camera
has none.

Where hardly a corner comes back to its place, the camera swung too fast, or the video was cut (see
`frame_cuts`). Nothing moves across a cut.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import reduce

import cv2
import numpy as np
from jaxtyping import Float, Int64, UInt8

from styletrf.capture.clips.frame_cuts import cuts
from styletrf.capture.clips.frame_flow import FrameFlow, flow_between, flow_of, small_picture
from styletrf.files.video_frames import TimedFrame
from styletrf.prefetch import in_background, prefetch

_LONG_SIDE = 480  # at which frames are looked at
_STRIDE = 0.03  # after which other corners are followed
_FRACTION_OF_PARALLAX = 0.05  # of the displacement, by which a camera that went places is known
_FEWEST_CORNERS = 8
_LEAST_FOLLOWED = 0.1  # of the corners
_LOST_DISPLACEMENT = 1.0  # of a swing too fast to follow
_AHEAD = 3  # frames that are decoded, and that are looked at, before their motion is

Gray = UInt8[np.ndarray, "height width"]
Colors = Float[np.ndarray, " bins"]
PerFrame = Float[np.ndarray, " frames"]


@dataclass(frozen=True, slots=True)
class FrameMotion:
    """Measures of a video's frames; motions in widths of the picture, added up since the first.

    `sharpness` is the variance of the Laplacian over that of the picture: texture alone makes no
    frame sharp. `shot` counts the cuts so far; `flow` is from each frame to the next.
    """

    time_s: PerFrame
    sharpness: PerFrame
    displacement: PerFrame
    parallax: PerFrame
    shot: Int64[np.ndarray, " frames"]
    flow: FrameFlow

    @property
    def has_parallax(self) -> bool:
        """Whether the camera moved to other places, rather than turned on the spot."""
        return bool(self.parallax[-1] > _FRACTION_OF_PARALLAX * self.displacement[-1])

    @property
    def cuts_s(self) -> list[float]:
        """The times in seconds of the first frame after each cut."""
        return [float(time) for time in self.time_s[1:][np.diff(self.shot) > 0]]


@dataclass(frozen=True, slots=True)
class _Look:
    """A frame at the size at which it is examined, and the camera's motion up to it."""

    time_s: float
    sharpness: float
    gray: Gray
    small: UInt8[np.ndarray, "rows columns"]
    colors: Colors
    so_far: Float[np.ndarray, "2"]


def frame_motion(frames: Iterable[TimedFrame]) -> FrameMotion:
    """Returns the measures of a video's frames; holds eight of them at a time.

    One thread decodes the frames, and another one examines each: neither needs the motion before
    it. All frames have one `examined_size`.
    """
    rows: list[tuple[float, ...]] = []
    reference = before = None
    for picture in _looks(frames):
        look, lost, change, flow = picture, False, 0.0, np.zeros(7)
        if reference is not None and before is not None:
            so_far, lost = _moved(reference, before, look.gray)
            look = replace(picture, so_far=so_far)
            change = 1 - float(np.minimum(look.colors, before.colors).sum())
            flow = flow_between(before.small, look.small)
        before = look
        if reference is None or lost or look.so_far[0] - reference.so_far[0] > _STRIDE:
            reference = look
        rows.append((look.time_s, look.sharpness, *look.so_far, lost, change, *flow))
    return _motion_of(np.array(rows, dtype=np.float64).reshape(-1, 13))


def _looks(frames: Iterable[TimedFrame]) -> Iterator[_Look]:
    """Yields the frames at the size at which they are examined; threads end with the iterator."""
    with closing(in_background(frames, ahead=_AHEAD)) as decoded:
        yield from prefetch(_look_at, decoded, threads=1, ahead=_AHEAD)


def _look_at(frame: TimedFrame) -> _Look:
    gray = _looked_at(frame.pixels)
    small, colors = small_picture(gray), _color_fractions(frame.pixels)
    return _Look(frame.time_s, _sharpness(gray), gray, small, colors, np.zeros(2))


def _motion_of(rows: Float[np.ndarray, "frames 13"]) -> FrameMotion:
    """Returns the motion without the steps across cuts."""
    time_s, sharp, displacement, parallax, lost, change = rows[:, :6].T
    flow = flow_of(rows[:, 6:])
    first = cuts(time_s, flow, lost > 0, change)
    ways = [way - np.cumsum(np.diff(way, prepend=0.0) * first) for way in (displacement, parallax)]
    return FrameMotion(time_s, sharp, ways[0], ways[1], np.cumsum(first, dtype=np.int64), flow)


def joined_motion(motions: Sequence[FrameMotion]) -> FrameMotion:
    """Returns the frames of clips one after another, as if cut together; each keeps its times.

    Every clip has a frame.
    """
    return reduce(_continued, motions)


def _continued(first: FrameMotion, then: FrameMotion) -> FrameMotion:
    return FrameMotion(
        np.append(first.time_s, then.time_s),
        np.append(first.sharpness, then.sharpness),
        np.append(first.displacement, first.displacement[-1] + then.displacement),
        np.append(first.parallax, first.parallax[-1] + then.parallax),
        np.append(first.shot, first.shot[-1] + 1 + then.shot),
        first.flow.then(then.flow),
    )


def sharpness(image: UInt8[np.ndarray, "height width 3"]) -> float:
    """Returns the variance of the image's Laplacian over its own, at most 480 pixels a side."""
    return _sharpness(_looked_at(image))


def _moved(reference: _Look, before: _Look, gray: Gray) -> tuple[Float[np.ndarray, "2"], bool]:
    """Returns the motion since the first frame, and whether the corners were lost."""
    for look in (reference, before):
        motion = _motion(look.gray, gray)
        if motion is not None:
            return look.so_far + motion, False
    return before.so_far + np.array([_LOST_DISPLACEMENT, 0.0]), True


def examined_size(height: int, width: int) -> tuple[int, int]:
    """Returns the width and height at which frames of a size are examined."""
    scale = min(1.0, _LONG_SIDE / max(height, width))
    return max(1, round(width * scale)), max(1, round(height * scale))


def _looked_at(frame: UInt8[np.ndarray, "_ _ 3"]) -> UInt8[np.ndarray, "_ _"]:
    gray = cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY)
    return np.asarray(cv2.resize(gray, examined_size(*gray.shape), interpolation=cv2.INTER_AREA))


def _color_fractions(frame: UInt8[np.ndarray, "height width 3"]) -> Colors:
    """Returns the fraction of the pixels in each of 8 x 8 x 8 cells of RGB."""
    small = cv2.resize(frame, (96, 96), interpolation=cv2.INTER_AREA).astype(np.int64) // 32
    cells = np.bincount(small.reshape(-1, 3) @ [64, 8, 1], minlength=512)
    return np.asarray(cells / cells.sum())


def _sharpness(gray: Gray) -> float:
    return float(cv2.Laplacian(gray, cv2.CV_64F).var() / max(gray.astype(np.float64).var(), 1.0))


def _motion(before: Gray, after: Gray) -> Float[np.ndarray, "2"] | None:
    """Returns the median displacement of corners, and the mean that no homography explains.

    None where hardly any corner is found again, and from there its way back.
    """
    corners = _corners(before)
    if len(corners) < _FEWEST_CORNERS:
        return None if len(_corners(after)) >= _FEWEST_CORNERS else np.zeros(2)
    there, is_there, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, corners.copy())
    back, is_back, _ = cv2.calcOpticalFlowPyrLK(after, before, there, there.copy())
    returned = np.linalg.norm(back - corners, axis=-1)[:, 0] < 1.0
    kept = returned & (is_there[:, 0] == 1) & (is_back[:, 0] == 1)
    old, new = corners[kept, 0], there[kept, 0]
    if len(old) < max(_FEWEST_CORNERS, _LEAST_FOLLOWED * len(corners)):
        return None
    displacement = float(np.median(np.linalg.norm(new - old, axis=1)))
    homography, _ = cv2.findHomography(old, new, cv2.RANSAC, 1.0)
    unexplained = 0.0
    if homography is not None:
        explained = cv2.perspectiveTransform(old[:, None], homography)[:, 0]
        unexplained = float(np.mean(np.linalg.norm(new - explained, axis=1)))
    return np.asarray([displacement, unexplained]) / np.float64(before.shape[1])


def _corners(gray: Gray) -> Float[np.ndarray, "corners 1 2"]:
    found = cv2.goodFeaturesToTrack(gray, maxCorners=400, qualityLevel=0.01, minDistance=6)
    return np.zeros((0, 1, 2), np.float32) if np.ndim(found) == 0 else found  # None for none
