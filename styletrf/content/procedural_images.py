"""Images that were never photographed but have the statistics that photographs share.

Amplitude spectra that fall as 1/f (Field 1987) and occlusion by objects of every size, as in the
dead leaves model (Lee, Mumford and Huang 2001). A style network learns from them how to paint
edges, textures and smooth shading, where no photographs are at hand.
"""

import cv2
import numpy as np
from jaxtyping import Float, UInt8

_N_LEAVES = 60
_N_NOISES = 4
_SATURATION = 0.12  # deviation of a leaf's R, G and B from its brightness: photographs are grayish


def procedural_image(
    generator: np.random.Generator, height: int, width: int
) -> UInt8[np.ndarray, "height width 3"]:
    """Returns one image: leaves of textured color over a textured, shaded ground."""
    exponents = generator.uniform(0.8, 1.6, _N_NOISES)
    noises = np.stack([spectral_noise(generator, height, width, e) for e in exponents])
    image = _texture(generator, noises)
    radii = min(height, width) / 2 * np.sort(generator.uniform(0.03, 1, _N_LEAVES) ** 2)[::-1]
    for radius in radii[: generator.integers(_N_LEAVES // 4, _N_LEAVES + 1)]:
        mask = _leaf(generator, height, width, float(radius))
        rows, columns = _extent(mask.max(axis=1)), _extent(mask.max(axis=0))
        coverage = mask[rows, columns, None] / np.float32(255)
        part = image[rows, columns]
        part += coverage * (_texture(generator, noises[:, rows, columns]) - part)
    return np.asarray(np.rint(255 * image), dtype=np.uint8)


def spectral_noise(
    generator: np.random.Generator, height: int, width: int, exponent: float
) -> Float[np.ndarray, "height width"]:
    """Returns noise of amplitude `1 / f^exponent`, of zero mean and unit variance, periodic."""
    fy = np.fft.fftfreq(height)[:, None]
    fx = np.fft.rfftfreq(width)[None, :]
    frequency = np.hypot(fy, fx)
    frequency[0, 0] = np.inf
    spectrum = np.fft.rfft2(generator.standard_normal((height, width))) / frequency**exponent
    noise = np.fft.irfft2(spectrum, s=(height, width))
    return np.asarray(noise / noise.std())


def _texture(
    generator: np.random.Generator, noises: Float[np.ndarray, "noises height width"]
) -> Float[np.ndarray, "height width 3"]:
    """Returns a color, shaded along a line, with one of the noises along a direction of color."""
    _, height, width = noises.shape
    base = generator.uniform(0.05, 0.95) + generator.normal(0, _SATURATION, 3)
    axis = generator.normal(0, 1, 3)
    y, x = np.ogrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    angle = generator.uniform(0, 2 * np.pi)
    shading = generator.uniform(0, 0.25) * (np.cos(angle) * x + np.sin(angle) * y)
    noise = generator.uniform(0, 0.15) * noises[generator.integers(len(noises))]
    colored = noise[..., None] * (0.6 + 0.4 * axis / np.linalg.norm(axis))
    return np.asarray(np.clip(base + shading[..., None] + colored, 0, 1), dtype=np.float32)


def _leaf(
    generator: np.random.Generator, height: int, width: int, radius: float
) -> UInt8[np.ndarray, "height width"]:
    """Returns the coverage, of 255, of an anti-aliased ellipse or polygon of about this radius."""
    mask = np.zeros((height, width), dtype=np.uint8)
    center = generator.uniform((0, 0), (width, height))
    corners = int(generator.choice([3, 4, 5, 64]))
    turns = 2 * np.pi * (np.arange(corners) / corners + generator.uniform())
    aspect = generator.uniform(0.2, 1)
    outline = np.stack([np.cos(turns), aspect * np.sin(turns)], axis=1) * max(radius, 2)
    spin = generator.uniform(0, np.pi)
    rotation = np.array([[np.cos(spin), np.sin(spin)], [-np.sin(spin), np.cos(spin)]])
    points = np.rint((outline @ rotation + center) * 16).astype(np.int32)
    cv2.fillPoly(mask, [points], color=(255,), lineType=cv2.LINE_AA, shift=4)
    return mask


def _extent(marked: UInt8[np.ndarray, " n"]) -> slice:
    """Returns the slice from the first to the last element that is not zero."""
    places = np.flatnonzero(marked)
    return slice(int(places[0]), int(places[-1]) + 1) if places.size else slice(0, 0)
