"""Frames of clips that turn, walk or keep still."""

import cv2
import numpy as np

from styletrf.files.video_frames import TimedFrame

HEIGHT, WIDTH = 120, 160


def contrasted(image):
    return np.clip(128 + 6 * (image - 128), 0, 255).astype(np.uint8)


def wall(seed, tint=(1.0, 1.0, 1.0), width=3 * WIDTH):
    """A wall of texture, three times as wide as a frame."""
    noise = np.random.default_rng(seed).uniform(0, 255, (HEIGHT, width, 3))
    return cv2.GaussianBlur(noise, (0, 0), 2.0) * tint


def panned(picture, place_px, count, fraction=0.0):
    """A pan along a picture: `place_px(t)` is the left column at t frames.

    Rows are exposed one after another, the last `fraction` of a frame's time after the first.
    """
    rows, columns = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    image = contrasted(picture)
    frames = []
    for k in range(count):
        left = place_px(k + fraction * rows / HEIGHT).astype(np.float32)
        frames.append(cv2.remap(image, columns + left, rows, cv2.INTER_LINEAR))
    return frames


def turned(picture, count):
    """A turn on the spot: all moves alike."""
    return [contrasted(picture[:, x : x + WIDTH]) for x in np.arange(count) * 2]


def walked(picture, count):
    """A walk past two walls: the upper half is nearer and moves three times as fast."""
    half = HEIGHT // 2
    return [
        contrasted(
            np.vstack([picture[:half, 3 * x : 3 * x + WIDTH], picture[half:, x : x + WIDTH]])
        )
        for x in range(count)
    ]


def timed(frames, rate=12.0):
    return [TimedFrame(k / rate, frame) for k, frame in enumerate(frames)]
