"""Which frames of a video to take for photographs: sharp ones, an even parallax apart.

From a frame on some corners are followed (Lucas and Kanade 1981) until the picture has moved by 3 %
of its width, then others from there. Their displacement tells how the picture moved; what of it no
homography explains is parallax, which a turning or resting camera has none of. Frames stand at even
steps along

    travel = parallax + displacement / 10       in widths of the picture, since the first frame

so that a walk is taken densely, a turn on the spot just often enough to overlap, a rest not at all;
of the frames about each step the sharpest is taken.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int64, UInt8

from styletrf.errors import InputError

_LONG_SIDE = 480  # at which frames are looked at
_STRIDE = 0.03  # after which other corners are followed
_SHARE_OF_DISPLACEMENT = 0.1
_SHARE_OF_PARALLAX = 0.05  # of the displacement, by which a camera that went places is known
_REACH = 0.35  # of a step, within which a sharper frame is looked for
_LEAST_DISPLACEMENT = 0.02

Gray = UInt8[np.ndarray, "height width"]
PerFrame = Float[np.ndarray, " frames"]


@dataclass(frozen=True, slots=True)
class FrameMotion:
    """What a video's frames show; motions in widths of the picture, added up since the first.

    `sharpness` is the variance of the Laplacian over that of the picture: texture alone makes no
    frame sharp.
    """

    sharpness: PerFrame
    displacement: PerFrame
    parallax: PerFrame

    @property
    def has_parallax(self) -> bool:
        """Whether the camera went places, rather than turned on the spot."""
        return bool(self.parallax[-1] > _SHARE_OF_PARALLAX * self.displacement[-1])


def frame_motion(frames: Iterable[UInt8[np.ndarray, "height width 3"]]) -> FrameMotion:
    """Returns what the frames of a video show; holds two of them at a time."""
    rows: list[tuple[float, float, float]] = []
    reference, so_far = None, np.zeros(2)
    for frame in frames:
        gray = _looked_at(frame)
        reference = gray if reference is None else reference
        moved = np.array(_motion(reference, gray))
        rows.append((_sharpness(gray), *(so_far + moved)))
        if moved[0] > _STRIDE:
            reference, so_far = gray, so_far + moved
    sharpness, displacement, parallax = np.array(rows).reshape(-1, 3).T
    return FrameMotion(sharpness, displacement, parallax)


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
    share = motion.parallax + _SHARE_OF_DISPLACEMENT * motion.displacement
    travel = np.maximum.accumulate(share)
    step = travel[-1] / max(count - 1, 1)
    chosen = set()
    for target in np.linspace(0, travel[-1], count):
        nearby = np.flatnonzero(np.abs(travel - target) <= _REACH * step)
        if len(nearby) == 0:
            nearby = np.abs(travel - target).argmin()[None]
        chosen.add(int(nearby[motion.sharpness[nearby].argmax()]))
    return np.array(sorted(chosen), dtype=np.int64)


def sharpness(image: UInt8[np.ndarray, "height width 3"]) -> float:
    """Returns the variance of the image's Laplacian over its own, at most 480 pixels a side."""
    return _sharpness(_looked_at(image))


def _looked_at(frame: UInt8[np.ndarray, "height width 3"]) -> Gray:
    gray = cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY)
    scale = min(1.0, _LONG_SIDE / max(gray.shape))
    size = (max(1, round(gray.shape[1] * scale)), max(1, round(gray.shape[0] * scale)))
    return np.asarray(cv2.resize(gray, size, interpolation=cv2.INTER_AREA))


def _sharpness(gray: Gray) -> float:
    return float(cv2.Laplacian(gray, cv2.CV_64F).var() / max(gray.astype(np.float64).var(), 1.0))


def _motion(before: Gray, after: Gray) -> tuple[float, float]:
    """Returns the median displacement of corners, and the mean that no homography explains."""
    corners = _corners(before)
    if len(corners) < 8:
        return 0.0, 0.0
    found, is_found, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, corners.copy())
    kept = is_found[:, 0] == 1
    old, new = corners[kept, 0], found[kept, 0]
    if len(old) < 8:
        return 1.0, 0.0  # a cut, or a swing too fast to follow
    displacement = float(np.median(np.linalg.norm(new - old, axis=1)))
    homography, _ = cv2.findHomography(old, new, cv2.RANSAC, 1.0)
    unexplained = 0.0
    if homography is not None:
        explained = cv2.perspectiveTransform(old[:, None], homography)[:, 0]
        unexplained = float(np.mean(np.linalg.norm(new - explained, axis=1)))
    width = before.shape[1]
    return displacement / width, unexplained / width


def _corners(gray: Gray) -> Float[np.ndarray, "corners 1 2"]:
    found = cv2.goodFeaturesToTrack(gray, maxCorners=400, qualityLevel=0.01, minDistance=6)
    return np.zeros((0, 1, 2), np.float32) if np.ndim(found) == 0 else found  # None for none
