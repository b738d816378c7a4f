"""A video of a few frames."""

import numpy as np


def moving(seed, size=(48, 64), count=24):
    frame = np.random.default_rng(seed).integers(0, 255, (*size, 3), dtype=np.uint8)
    return [np.roll(frame, i, axis=1) for i in range(count)]
