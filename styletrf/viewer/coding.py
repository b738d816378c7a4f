"""Codes values at lattice points as whole numbers, and these as few bytes.

A value is given by its difference from the mean of its neighbors, in multiples of a spacing. The
spacings of colors widen from class to class of the effects of points on pictures (`point_effects`);
a point without a spacing takes the mean. The browser undoes this in `webpage/unpacking.js`.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from styletrf.viewer import lattice_kernels
from styletrf.viewer.compression import in_contexts, packed_bytes, sum_before, wrapped
from styletrf.viewer.lattice import SIDE
from styletrf.viewer.point_effects import CLASSES, Classes

FINEST_DENSITY = 1 / 4
"""The step of raw densities, unless their range needs a coarser one."""
MOST_OF_COLORS = 254
"""The greatest code of colors before their sigmoid, and of slopes."""
_LARGEST_MULTIPLE = 127  # to either side of 0, in a byte
_SLOPES_FINER = 2
"""The step of colors in that of slopes: these are less than that of colors at most points."""
LARGEST_LOGIT = 7.0
"""Beyond it colors count as black or full: 0.1 % of the brightness."""
WIDEST_SPACING = 127
Spacings = tuple[int, ...]
"""Odd spacings by class; 0 where a point takes the mean of its neighbors, as in class 0."""
FINEST: Spacings = (0,) + (1,) * CLASSES


@dataclass(frozen=True, slots=True)
class Codes:
    """Whole numbers that stand for values: `low + step * code`.

    Attributes:
        low: The value of code 0.
        step: The step from one code to the next.
        codes: The codes, not less than 0.
        by_green: Whether the first and the last of three channels are stored less the second.
    """

    low: float
    step: float
    codes: Int[np.ndarray, "points channels"]
    by_green: bool = False

    def values(self) -> Float[np.ndarray, "points channels"]:
        """Returns the values, in float32."""
        found: Float[np.ndarray, "points channels"] = self.codes.astype(np.float32)
        found *= np.float32(self.step)
        found += np.float32(self.low)
        return found


def density_codes(
    values: Float[np.ndarray, "points 1"], needed: Bool[np.ndarray, " points"]
) -> Codes:
    """Returns raw densities in 16 bits."""
    return _codes(values, needed, FINEST_DENSITY, 2**16 - 1, np.inf)


def color_codes(
    values: Float[np.ndarray, "points 3"], needed: Bool[np.ndarray, " points"]
) -> Codes:
    """Returns colors before their sigmoid."""
    found = _codes(values, needed, 0.0, MOST_OF_COLORS, LARGEST_LOGIT)
    return replace(found, by_green=True)


def slope_codes(values: Float[np.ndarray, "points 3"], color_step: float) -> Codes:
    """Returns slopes of colors; those that are steeper than codes reach are less steep then.

    Args:
        values: Along the axes of `ViewDirections`.
        color_step: The step of the colors' codes. Directions are about 1 along each axis, so an
            error of a slope changes a picture as much as one of a color.
    """
    step, middle = color_step / _SLOPES_FINER, MOST_OF_COLORS // 2
    codes = np.clip(np.rint(values / step), -middle, middle).astype(np.int32)
    return Codes(-middle * step, step, codes + middle)


def spacings_of(finest: float) -> Spacings:
    """Returns spacings that double from class to class; none wider than WIDEST_SPACING.

    Half the effect needs twice the spacing for the same error of pictures.

    Args:
        finest: The spacing of the class of the greatest effects, before it is rounded to an odd
            number.
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
    """Returns the colors or slopes that the browser decodes from those of `packed_colors`."""
    of_points = np.array(spacings, np.int32)[classes]
    first, green, last = (
        lattice_kernels.multiples(channel, of_points, most, _LARGEST_MULTIPLE)[1].ravel()
        for channel, most in _channels(codes)
    )
    if codes.by_green:
        first, last = first + green - MOST_OF_COLORS, last + green - MOST_OF_COLORS
    return replace(codes, codes=np.stack([first, green, last], axis=1).clip(0, MOST_OF_COLORS))


def packed_colors(codes: Codes, classes: Classes, spacings: Spacings) -> bytes:
    """Returns compressed multiples of three channels, one after another.

    Each channel begins with the first codes of bricks, less the least that they can be, by
    differences; then the multiples of the other points, class by class.
    """
    of_points = np.array(spacings, np.int32)[classes]
    has_multiple = of_points > 0
    has_multiple[:, 0] = False
    parts = []
    for channel, most in _channels(codes):
        multiples, shown = lattice_kernels.multiples(channel, of_points, most, _LARGEST_MULTIPLE)
        firsts = shown[:, 0] - (most // 2 - _LARGEST_MULTIPLE)
        of_classes = in_contexts(multiples[has_multiple], classes[has_multiple])
        parts += [np.diff(firsts, prepend=0), of_classes]
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
    most = 2**16 - 1
    multiples, shown = lattice_kernels.multiples(by_brick, spacings, most, most)
    multiples[:, 0] = shown[:, 0]
    differences = _zigzag(multiples)
    contexts = np.ceil(np.log2(1 + sum_before(differences))).astype(np.int64)
    ordered = in_contexts(differences, contexts)
    packed = packed_bytes(np.stack([ordered & 255, ordered >> 8]).astype(np.uint8))
    return packed, np.bincount(contexts.ravel()).tolist()


def _channels(codes: Codes) -> list[tuple[Int[np.ndarray, "bricks 512"], int]]:
    """Returns the channels that are stored, and the greatest code of each."""
    by_channel = np.ascontiguousarray(codes.codes.T, np.int32).reshape(3, -1, SIDE**3)
    if not codes.by_green:
        return [(channel, MOST_OF_COLORS) for channel in by_channel]
    red, green, blue = by_channel
    apart = [each - green + MOST_OF_COLORS for each in (red, blue)]
    most = 2 * MOST_OF_COLORS
    return [(apart[0], most), (green, MOST_OF_COLORS), (apart[1], most)]


def _zigzag(differences: Int[np.ndarray, "..."]) -> Int[np.ndarray, "..."]:
    """Returns 0, 1, 2, 3, 4 of 0, -1, 1, -2, 2, and so on, by modulo 2^16."""
    signed = (differences + 2**15) % 2**16 - 2**15
    return (signed << 1) ^ (signed >> 16)
