"""The canvas of a painting: fields over it, palettes, noise.

A canvas is `FINE` x `FINE` sRGB values in [0, 1], twice the size of the painting it becomes;
lengths are in its pixels.
"""

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

SIZE = 512
FINE = 2 * SIZE

Canvas = Float[np.ndarray, "fine fine 3"]
Field = Float[np.ndarray, "fine fine"]
Labels = Int[np.ndarray, "fine fine"]
Color = Float[np.ndarray, " 3"]
Points = Float[np.ndarray, "points 2"]
Painting = UInt8[np.ndarray, "size size 3"]


def coordinates() -> tuple[Field, Field]:
    """Returns x and y of the pixel centers in [0, 1]."""
    y, x = (np.mgrid[0:FINE, 0:FINE] + 0.5) / FINE
    return x, y


def rgb(name: str) -> Color:
    """Returns the sRGB color "#rrggbb"."""
    return np.array([int(name[i : i + 2], 16) for i in (1, 3, 5)]) / 255


def ramp(value: Field, names: str, start: float, stop: float) -> Canvas:
    """Returns colors blended along a palette as the value goes from `start` to `stop`."""
    palette = np.stack([rgb(name) for name in names.split()])
    stops = np.linspace(start, stop, len(palette))
    return np.stack([np.interp(value, stops, palette[:, c]) for c in range(3)], axis=-1)


def noise(cell: float | int, rng: np.random.Generator, stretch: float | int = 1) -> Field:
    """Returns unit-variance noise with features of `cell` pixels, `stretch` times that in y."""
    total = np.zeros((FINE, FINE))
    for octave in range(3):
        step = cell / 2**octave
        shape = int(FINE / (step * stretch)) + 3, int(FINE / step) + 3
        layer = cv2.resize(rng.standard_normal(shape), (FINE, FINE), interpolation=cv2.INTER_CUBIC)
        total += 0.55**octave * layer
    return np.asarray(total / total.std())


def finished(canvas: Canvas) -> Painting:
    """Returns the canvas at the painting's size."""
    small = cv2.resize(np.clip(canvas, 0, 1), (SIZE, SIZE), interpolation=cv2.INTER_AREA)
    return np.asarray(np.rint(255 * small), dtype=np.uint8)
