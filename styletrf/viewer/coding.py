"""Values at lattice points as whole numbers, and these as few bytes.

A value is given by its difference from the mean of its neighbors, in multiples of a spacing. The
spacings of colors widen from class to class of what a point changes in pictures
(`point_effects`); a point without a spacing takes the mean. The browser undoes this in
`webpage/unpacking.js`.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from styletrf.viewer import coding_kernels
from styletrf.viewer.compression import in_contexts, packed_bytes, sum_before, wrapped
from styletrf.viewer.lattice import SIDE
from styletrf.viewer.point_effects import CLASSES, Classes

FINEST_DENSITY = 1 / 4
"""The step of raw densities, unless their range needs a coarser one."""
COLOR_LEVELS = 128
"""Of colors before their sigmoid, where pictures change most; elsewhere spacings are wider."""
_MOST_OF_COLORS = (255, COLOR_LEVELS - 1, 255)
"""Of red less green, green, and blue less green; 128 is no difference."""
LARGEST_LOGIT = 7.0
"""Beyond it colors count as black or full: 0.1 % of the brightness."""
WIDEST_SPACING = 63
Spacings = tuple[int, ...]
"""Of each class, odd; 0 where a point takes the mean of its neighbors, as the class 0 does."""
FINEST: Spacings = (0,) + (1,) * CLASSES


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


def spacings_of(finest: float) -> Spacings:
    """Returns spacings that double from class to class; none wider than WIDEST_SPACING.

    Half the effect needs twice the spacing for the same error of pictures.

    Args:
        finest: Of the class of the greatest effects, before it is rounded to an odd number.
    """
    wide = finest * 2.0 ** np.arange(CLASSES)
    odd = 2 * (wide // 2).astype(int) + 1
    return 0, *np.where(odd > WIDEST_SPACING, 0, odd).tolist()


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


def shown_colors(codes: Codes, classes: Classes, spacings: Spacings) -> Codes:
    """Returns the colors that the browser makes of what `packed_colors` returns."""
    of_points = np.array(spacings, np.int32)[classes]
    channels = [
        coding_kernels.multiples(channel, of_points, most)[1]
        for channel, most in zip(_channels(codes.codes), _MOST_OF_COLORS, strict=True)
    ]
    red, green, blue = (channel.ravel() for channel in channels)
    shown = np.stack([red + green - 128, green, blue + green - 128], axis=1)
    return replace(codes, codes=shown.clip(0, COLOR_LEVELS - 1))


def packed_colors(
    codes: Int[np.ndarray, "points 3"], classes: Classes, spacings: Spacings
) -> bytes:
    """Returns compressed multiples: of red less green, then of green, then of blue less green.

    Of each channel there are the first codes of bricks, then the multiples of the other points,
    class by class.
    """
    of_points = np.array(spacings, np.int32)[classes]
    has_multiple = of_points > 0
    has_multiple[:, 0] = False
    parts = []
    for channel, most in zip(_channels(codes), _MOST_OF_COLORS, strict=True):
        multiples, shown = coding_kernels.multiples(channel, of_points, most)
        of_classes = in_contexts(multiples[has_multiple], classes[has_multiple])
        parts += [np.diff(shown[:, 0], prepend=0), of_classes]
    return packed_bytes(wrapped(np.concatenate(parts)))


def packed_density(
    codes: Int[np.ndarray, "points 1"], needed: Bool[np.ndarray, "bricks 512"]
) -> tuple[bytes, list[int]]:
    """Returns compressed differences of densities, and how many each of their contexts has.

    Differences are 0, -1, 1, -2 and so on, by 0, 1, 2, 3. The context of a difference is the
    number of binary digits of the sum of those before it. Low bytes come before high ones.
    Points that are not needed take the mean of their neighbors.
    """
    by_brick, spacings = codes.astype(np.int32).reshape(needed.shape), needed.astype(np.int32)
    multiples, shown = coding_kernels.multiples(by_brick, spacings, 2**16 - 1)
    multiples[:, 0] = shown[:, 0]
    differences = _zigzag(multiples)
    contexts = np.ceil(np.log2(1 + sum_before(differences))).astype(np.int64)
    ordered = in_contexts(differences, contexts)
    packed = packed_bytes(np.stack([ordered & 255, ordered >> 8]).astype(np.uint8))
    return packed, np.bincount(contexts.ravel()).tolist()


def _channels(codes: Int[np.ndarray, "points 3"]) -> list[Int[np.ndarray, "bricks 512"]]:
    red, green, blue = codes.astype(np.int32).T.reshape(3, -1, SIDE**3)
    return [red - green + 128, np.ascontiguousarray(green), blue - green + 128]


def _zigzag(differences: Int[np.ndarray, "..."]) -> Int[np.ndarray, "..."]:
    """Returns 0, 1, 2, 3, 4 of 0, -1, 1, -2, 2, and so on, by modulo 2^16."""
    signed = (differences + 2**15) % 2**16 - 2**15
    return (signed << 1) ^ (signed >> 16)
