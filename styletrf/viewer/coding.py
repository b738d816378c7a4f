"""Values at lattice points as few bytes: whole numbers, their differences, zlib.

What no sample needs takes the mean of its neighbors, whose difference is 0. The browser undoes this
in `webpage/unpacking.js`.
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
LARGEST_LOGIT = 7.0
"""Beyond it colors count as black or full: 0.1 % of the brightness."""


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


def filled(codes: Codes, needed: Bool[np.ndarray, "bricks 512"]) -> Codes:
    """Returns colors whose points that are not needed have what the browser makes of them.

    That is the mean of their neighbors, see `packed_codes`.
    """
    channels = [c.reshape(needed.shape).copy() for c in _decorrelated(codes.codes).T]
    for channel in channels:
        _differences(channel, needed)
    red, green, blue = (channel.ravel() for channel in channels)
    shown = np.stack([red + green - 128, green, blue + green - 128], axis=1)
    return replace(codes, codes=shown.clip(0, COLOR_LEVELS - 1))


def packed_codes(
    codes: Int[np.ndarray, "points channels"],
    needed: Bool[np.ndarray, "bricks 512"],
    n_bytes: int,
) -> bytes:
    """Returns the compressed differences of codes from the mean of their neighbors.

    These are the points before along x, y and z in the same brick. Of three channels the first and
    the last are given by their difference from the second, and 128. The channels of a point are
    side by side. Of two bytes the low ones of all points come before the high ones, and
    differences are 0, -1, 1, -2 and so on, whose high bytes are mostly 0.
    """
    channels = [
        _differences(channel.copy(), needed)
        for channel in _decorrelated(codes).T.reshape(codes.shape[1], *needed.shape)
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
    codes: Int[np.ndarray, "bricks 512"], needed: Bool[np.ndarray, "bricks 512"]
) -> Int[np.ndarray, "bricks 512"]:
    """Returns codes less the mean of their neighbors; 0 where they are not needed.

    A brick begins with the first code that is. `codes` then has the means where none is needed.
    """
    differences = np.zeros_like(codes)
    first = codes[np.arange(len(codes)), needed.argmax(axis=1)]
    codes[:, 0] = np.where(needed[:, 0], codes[:, 0], first)
    differences[:, 0] = codes[:, 0]
    for point in range(1, SIDE**3):
        z, y, x = point // SIDE**2, point // SIDE % SIDE, point % SIDE
        steps = [step for step, at in ((1, x), (SIDE, y), (SIDE**2, z)) if at > 0]
        mean = sum(codes[:, point - step] for step in steps) // len(steps)
        codes[:, point] = np.where(needed[:, point], codes[:, point], mean)
        differences[:, point] = codes[:, point] - mean
    return differences
