"""Values at lattice points as few bytes: whole numbers, their differences, zlib.

A difference is a multiple of the point's spacing: 1 where a picture shows the value, more where the
value has little weight in any picture. What no sample needs has spacing 0 and takes the mean of its
neighbors. The browser undoes this in `webpage/unpacking.js`, without knowing the spacings.
"""

import zlib
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from styletrf.viewer.lattice import SIDE

FINEST_DENSITY = 1 / 32
"""The step of raw densities, unless their range needs a coarser one."""
COLOR_LEVELS = 64
"""Of colors before their sigmoid: pictures have about 50 dB, and 256 levels would double a page."""
_MOST_OF_COLORS = (255, COLOR_LEVELS - 1, 255)
"""Of red less green, green, and blue less green; 128 is no difference."""
LARGEST_LOGIT = 7.0
"""Beyond it colors count as black or full: 0.1 % of the brightness."""
WIDEST_SPACING = 31
Spacings = UInt8[np.ndarray, "bricks 512"]
"""Of the differences at points, odd; 0 where they are 0."""


@dataclass(frozen=True, slots=True)
class Codes:
    """Whole numbers that stand for values: `low + step * code`."""

    low: float
    step: float
    codes: Int[np.ndarray, "points channels"]

    def values(self) -> Float[np.ndarray, "points channels"]:
        """Returns the values, in float32."""
        return (self.low + self.step * self.codes).astype(np.float32)


def density_codes(
    values: Float[np.ndarray, "points 1"], needed: Bool[np.ndarray, " points"]
) -> Codes:
    """Returns raw densities in 16 bits."""
    return _codes(values, needed, FINEST_DENSITY, 2**16 - 1, np.inf)


def color_codes(
    values: Float[np.ndarray, "points 3"], needed: Bool[np.ndarray, " points"]
) -> Codes:
    """Returns colors before their sigmoid by COLOR_LEVELS."""
    return _codes(values, needed, 0.0, COLOR_LEVELS - 1, LARGEST_LOGIT)


def slope_codes(
    values: Float[np.ndarray, "points 3"], needed: Bool[np.ndarray, " points"]
) -> Codes:
    """Returns slopes of colors by COLOR_LEVELS; the steepest in a thousand are less steep then."""
    counted = np.abs(values[needed]) if needed.any() else np.zeros(1)
    return _codes(values, needed, 0.0, COLOR_LEVELS - 1, float(np.quantile(counted, 0.999)))


def spacings_of(weights: UInt8[np.ndarray, "bricks 512"], share_of_weight: float) -> Spacings:
    """Returns spacings that a weight makes as visible as `share_of_weight` steps; none at most 31.

    Args:
        weights: The greatest of each point in any picture, times 255.
        share_of_weight: Of a step, times the weight; 0 is a spacing of 1 wherever there is weight.
    """
    table = np.arange(256) / 255
    steps = share_of_weight / np.maximum(table, 1e-9)
    spacings = 2 * np.floor(steps / 2) + 1
    spacings[(spacings > WIDEST_SPACING) | (table == 0)] = 0
    found: Spacings = spacings.astype(np.uint8)[weights]
    return found


def _codes(
    values: Float[np.ndarray, "points channels"],
    needed: Bool[np.ndarray, " points"],
    finest: float,
    most: int,
    largest: float,
) -> Codes:
    clipped = np.clip(values, -largest, largest)
    counted = clipped[needed] if needed.any() else np.zeros((1, 1), np.float32)
    low, high = float(counted.min()), float(counted.max())
    step = max((high - low) / most, finest) or 1.0
    codes = np.clip(np.rint((clipped - low) / step), 0, most).astype(np.int32)
    return Codes(low, step, codes)


def shown_colors(codes: Codes, spacings: Spacings) -> Codes:
    """Returns the colors that the browser makes of what `packed_codes` returns."""
    channels = _decorrelated(codes.codes).T.reshape(3, *spacings.shape).copy()
    for channel, most in zip(channels, _MOST_OF_COLORS, strict=True):
        _differences(channel, spacings, most)
    red, green, blue = channels.reshape(3, -1)
    shown = np.stack([red + green - 128, green, blue + green - 128], axis=1)
    return replace(codes, codes=shown.clip(0, COLOR_LEVELS - 1))


def packed_codes(
    codes: Int[np.ndarray, "points channels"], spacings: Spacings, n_bytes: int
) -> bytes:
    """Returns the compressed differences of codes from the mean of their neighbors.

    These are the points before along x, y and z in the same brick. Of three channels the first and
    the last are given by their difference from the second, and 128. The channels of a point are
    side by side. Of two bytes the low ones of all points come before the high ones, and
    differences are 0, -1, 1, -2 and so on, whose high bytes are mostly 0.
    """
    of_channels = _decorrelated(codes).T.reshape(codes.shape[1], *spacings.shape)
    most = _MOST_OF_COLORS if len(of_channels) == 3 else (256**n_bytes - 1,)
    channels = [
        _differences(channel.copy(), spacings, most_of_channel)
        for channel, most_of_channel in zip(of_channels, most, strict=True)
    ]
    differences = np.stack(channels, axis=-1)
    if n_bytes == 2:
        differences = _zigzag(differences)
    planes = [(differences >> 8 * k) & 255 for k in range(n_bytes)]
    return packed_bytes(np.stack(planes).astype(np.uint8), zlib.Z_RLE)


def _zigzag(differences: Int[np.ndarray, "..."]) -> Int[np.ndarray, "..."]:
    """Returns 0, 1, 2, 3, 4 of 0, -1, 1, -2, 2, and so on, by modulo 2^16."""
    signed = (differences + 2**15) % 2**16 - 2**15
    return (signed << 1) ^ (signed >> 16)


def _decorrelated(codes: Int[np.ndarray, "points channels"]) -> Int[np.ndarray, "points channels"]:
    if codes.shape[1] != 3:
        return codes
    red, green, blue = codes.T
    return np.stack([red - green + 128, green, blue - green + 128], axis=1)


def packed_bytes(
    values: UInt8[np.ndarray, "..."], strategy: int = zlib.Z_DEFAULT_STRATEGY
) -> bytes:
    """Returns the compressed bytes of an array in its order in memory.

    Args:
        values: The bytes.
        strategy: Of zlib; `Z_RLE` suits noise with runs in it, since chance repetitions cost more
            than the bytes themselves.
    """
    packing = zlib.compressobj(9, zlib.DEFLATED, zlib.MAX_WBITS, 9, strategy)
    return packing.compress(np.ascontiguousarray(values).tobytes()) + packing.flush()


def _differences(
    codes: Int[np.ndarray, "bricks 512"], spacings: Spacings, most: int
) -> Int[np.ndarray, "bricks 512"]:
    """Returns codes less the mean of their neighbors, as multiples of the spacings.

    A brick begins with the first code that has a spacing. `codes` then has what comes of the
    differences: at most half a spacing off, and from 0 to `most`.
    """
    differences = np.zeros_like(codes)
    first = codes[np.arange(len(codes)), (spacings > 0).argmax(axis=1)]
    codes[:, 0] = np.where(spacings[:, 0] > 0, codes[:, 0], first)
    differences[:, 0] = codes[:, 0]
    for point in range(1, SIDE**3):
        z, y, x = point // SIDE**2, point // SIDE % SIDE, point % SIDE
        steps = [step for step, at in ((1, x), (SIDE, y), (SIDE**2, z)) if at > 0]
        mean = sum(codes[:, point - step] for step in steps) // len(steps)
        spacing = spacings[:, point].astype(codes.dtype)
        half, at_least_one = spacing // 2, np.maximum(spacing, 1)
        rounded = (codes[:, point] - mean + half) // at_least_one * spacing
        codes[:, point] = (mean + rounded).clip(0, most)
        differences[:, point] = codes[:, point] - mean
    return differences
