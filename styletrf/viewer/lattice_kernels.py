"""Sums over the lattice points around samples, and differences of points in a brick; compiled.

    value(x) = sum_k h_k(x) value_k,   h_k: trilinear weight of point k

Points that are not stored count as 0, as in the viewer.
"""

from typing import no_type_check

import numba
import numpy as np

from styletrf.compiled import compiled
from styletrf.viewer.lattice import SIDE


@no_type_check
@compiled(inline="always")
def around(slots, low, rest, points, corner_weights):
    """Sets the addresses of the 8 points around a place, and its trilinear weights."""
    for corner in range(8):
        x, y, z = low[0] + (corner & 1), low[1] + (corner >> 1 & 1), low[2] + (corner >> 2)
        slot = slots[x // SIDE, y // SIDE, z // SIDE]
        corner_weight = rest[0] if corner & 1 else 1 - rest[0]
        corner_weight *= rest[1] if corner & 2 else 1 - rest[1]
        corner_weight *= rest[2] if corner & 4 else 1 - rest[2]
        points[corner] = ((max(slot, 0) * SIDE + z % SIDE) * SIDE + y % SIDE) * SIDE + x % SIDE
        corner_weights[corner] = corner_weight if slot >= 0 else 0


@no_type_check
@compiled(parallel=True)
def interpolated(slots, low, rest, values):
    """Returns the interpolated values of samples, `samples channels`.

    Args:
        slots: Of the bricks, see `BrickLattice`.
        low: The lowest of the 8 points around each sample, `samples 3`.
        rest: Where the sample is between them, in [0, 1], `samples 3`.
        values: The values of the points, `points channels`.
    """
    found = np.zeros((len(low), values.shape[1]), values.dtype)
    for sample in numba.prange(len(low)):
        points, corner_weights = np.empty(8, np.int64), np.empty(8, rest.dtype)
        around(slots, low[sample], rest[sample], points, corner_weights)
        for corner in range(8):
            for channel in range(values.shape[1]):
                found[sample, channel] += corner_weights[corner] * values[points[corner], channel]
    return found


@no_type_check
@compiled()
def add_squares(slots, low, rest, weights, picture, sums):
    """Adds the squared weights of a picture's samples to the points around them.

    Args:
        slots: Of the bricks, see `BrickLattice`.
        low: The lowest of the 8 points around each sample, `samples 3`.
        rest: Where the sample is between them, in [0, 1], `samples 3`.
        weights: Of the samples.
        picture: Its number, from 1.
        sums: For each point, the last picture that shows it, its sum, and the greatest sum of the
            pictures before, `points 3`. Zeros before the first.
    """
    points, corner_weights = np.empty(8, np.int64), np.empty(8, np.float32)
    for sample in range(len(weights)):
        around(slots, low[sample], rest[sample], points, corner_weights)
        for corner in range(8):
            of_point = sums[points[corner]]
            if of_point[0] != picture:
                of_point[0], of_point[1], of_point[2] = picture, 0, max(of_point[1], of_point[2])
            of_point[1] += (weights[sample] * corner_weights[corner]) ** 2


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
    """Returns the multiples of the spacings that lead from means to codes, and the resulting codes.

    The results are at most half a spacing off, or less than one at the ends, and from 0 to `most`;
    farther off where the multiple would be more than `largest`. A brick begins with its first code
    that has a spacing, which is no multiple; it is at most `largest` from the middle.

    Args:
        codes: The codes of the points, `bricks 512`.
        spacings: The spacings of the points; 0 for one that takes the mean, `bricks 512`.
        most: The greatest code.
        largest: The largest multiple, to either side.
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
