"""Frames of clips that turn, walk or keep still."""

import numpy as np

from styletrf.files.video import TimedFrame

HEIGHT, WIDTH = 120, 160


def contrasted(image):
    return np.clip(128 + 6 * (image - 128), 0, 255).astype(np.uint8)


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
