"""Multiples of spacings that lead from means of neighbors to codes; compiled."""

from typing import no_type_check

import numba
import numpy as np

from styletrf.compiled import compiled
from styletrf.viewer.lattice import SIDE


@no_type_check
@compiled(inline="always")
def _first_with_spacing(spacings):
    """Returns the first point of a brick that has a spacing; 0 where none has."""
    first = 0
    for point in range(SIDE**3 - 1, -1, -1):
        if spacings[point] > 0:
            first = point
    return first


@no_type_check
@compiled(inline="always")
def _mean_before(shown, point):
    """Returns the mean of the points before along x, y and z in the same brick, rounded down."""
    total, count, step, rest = 0, 0, 1, point
    for _axis in range(3):
        if rest % SIDE > 0:
            total += shown[point - step]
            count += 1
        step, rest = step * SIDE, rest // SIDE
    return total // count


@no_type_check
@compiled(parallel=True)
def multiples(codes, spacings, most, largest):
    """Returns the multiples of the spacings that lead from means to codes, and what they lead to.

    What multiples lead to is at most half a spacing off, or less than one at the ends, and from 0
    to `most`; farther off where the multiple would be more than `largest`. A brick begins with its
    first code that has a spacing, which is no multiple; it is at most `largest` from the middle.

    Args:
        codes: Of the points, `bricks 512`.
        spacings: Of the points; 0 for one that takes the mean, `bricks 512`.
        most: The greatest code.
        largest: Of the multiples, to either side.
    """
    found, shown = np.zeros_like(codes), np.empty_like(codes)
    for brick in numba.prange(len(codes)):
        of_codes, of_spacings, of_shown = codes[brick], spacings[brick], shown[brick]
        from_middle = of_codes[_first_with_spacing(of_spacings)] - most // 2
        of_shown[0] = most // 2 + min(max(from_middle, -largest), largest)
        for point in range(1, SIDE**3):
            mean, spacing = _mean_before(of_shown, point), of_spacings[point]
            multiple = 0
            if spacing > 0:
                nearest = (of_codes[point] - mean + spacing // 2) // spacing
                within = min(max(nearest, -(mean // spacing)), (most - mean) // spacing)
                multiple = min(max(within, -largest), largest)
            found[brick, point] = multiple
            of_shown[point] = mean + multiple * spacing
    return found, shown
