"""Renders pictures from lattice points, and compares them with a field's colors; compiled.

    shown_s = sigmoid(sum_k h_k(x_s) (base_k + slope_k . t) + tint),   h_k: trilinear weight of k
    residual_r = sum_s w_s (c_s - shown_s)                              of a ray r

with samples s of a ray at x_s, of weight w_s and color c_s, and the ray's turned direction t.
Points that are not stored count as 0, as in the viewer.

A step dc of the tint sum_k c_k q_k(t) changes a ray's color by J dc, with J_k = q_k sum_s w_s
shown_s (1 - shown_s). The sums over rays of J J^T and J residual_r are the normal equations of the
step of Gauss and Newton. As for points, no steepness shown_s (1 - shown_s) counts for less than
LEAST_STEEPNESS: so white and black colors change by little.
"""

from typing import no_type_check

import numba
import numpy as np

from styletrf.compiled import compiled
from styletrf.viewer.lattice_kernels import around

BANDS = 2  # of rays, each with sums of its own: the result does not depend on the threads
LEAST_STEEPNESS = np.float32(0.05)  # of the sigmoid


@no_type_check
@compiled(inline="always", fastmath=True)
def _show(points, corner_weights, values, direction, tint, color):
    """Sets `color` to the color that a place shows along a direction."""
    color[:] = tint
    for corner in range(8):
        value = values[points[corner]]
        turned = value[3] * direction[0] + value[4] * direction[1] + value[5] * direction[2]
        for k in range(3):
            color[k] += corner_weights[corner] * (value[k] + turned)
    for k in range(3):
        color[k] = 1 / (1 + np.exp(-color[k]))


@no_type_check
@compiled(inline="always", fastmath=True)
def _back_project(points, corner_weights, amount, direction, sums):
    """Adds an amount of each channel to the points around a place, and its mean to slopes."""
    mean = (amount[0] + amount[1] + amount[2]) / 3
    for corner in range(8):
        point, corner_weight = points[corner], corner_weights[corner]
        for k in range(3):
            sums[point, k] += corner_weight * amount[k]
            sums[point, 3 + k] += corner_weight * mean * direction[k]


@no_type_check
@compiled(inline="always", fastmath=True)
def _set_tint(direction, coefficients, monomials, tint):
    """Sets the monomials, in the order of `MONOMIALS`, and the tint to those of a direction."""
    tint[:] = 0
    n = 0
    for i in range(3):
        monomials[n] = direction[i]
        n += 1
        for j in range(i, 3):
            monomials[n] = direction[i] * direction[j]
            n += 1
            for k in range(j, 3):
                monomials[n] = direction[i] * direction[j] * direction[k]
                n += 1
    for n in range(len(monomials)):
        for channel in range(3):
            tint[channel] += monomials[n] * coefficients[n, channel]


@no_type_check
@compiled(inline="always", fastmath=True)
def _add_equations(monomials, steepness, residual, equations):
    """Adds a ray's part to the normal equations of each channel, from the diagonal on."""
    n_monomials = len(monomials)
    for channel in range(3):
        for row in range(n_monomials):
            factor = steepness[channel] * monomials[row]
            for column in range(row, n_monomials):
                equations[channel, row, column] += factor * steepness[channel] * monomials[column]
            equations[channel, row, n_monomials] += factor * residual[channel]


@no_type_check
@compiled(parallel=True)
def _sum_of_bands(sums):
    for point in numba.prange(sums.shape[1]):
        for band in range(1, BANDS):
            sums[0, point] += sums[band, point]
    return sums[0]


@no_type_check
@compiled(parallel=True, fastmath=True)
def residuals(
    slots, low, rest, weights, colors, starts, directions, coefficients, every, values, of_samples,
    sums,
):  # fmt: skip
    """Returns the residuals of points, and the normal equations of the tint.

    The residual of a point sums those of the samples around it, `points 6`. That of a sample is its
    part of its ray's and, `of_samples` as much, its own. The equations are those above of each
    channel, `3 monomials monomials_and_one`: J J^T from its diagonal on, and the right side last.

    Args:
        slots: The slots of the bricks, see `BrickLattice`.
        low: The lowest of the 8 points around each sample, `samples 3`.
        rest: Where the sample is between them, in [0, 1], `samples 3`.
        weights: The weights of the samples.
        colors: The colors of the samples, `samples 3`.
        starts: The first sample of each ray, and the number of all.
        directions: The turned directions of the rays, see `ViewDirections`, `rays 3`.
        coefficients: The c_k of the tint, see `ViewDirections`, `monomials 3`.
        every: Every n-th ray enters the equations.
        values: Those of the points: three of the base, three of the slope, `points 6`.
        of_samples: The weight of samples, in [0, 1].
        sums: Room for the sums of bands, `BANDS points 6`; the first of them is returned.
    """
    rays, longest = len(starts) - 1, (starts[1:] - starts[:-1]).max()
    equations = np.zeros((BANDS, 3, len(coefficients), len(coefficients) + 1), np.float64)
    for band in numba.prange(BANDS):
        points, corner_weights = (
            np.empty((longest, 8), np.int64),
            np.empty((longest, 8), np.float32),
        )
        missing, steepness = np.empty((longest, 3), np.float32), np.empty((longest, 3), np.float32)
        of_ray, amount = np.empty(3, np.float32), np.empty(3, np.float32)
        steepness_of_ray, tint_of_ray = np.empty(3, np.float32), np.empty(3, np.float32)
        monomials = np.empty(len(coefficients), np.float32)
        sums[band] = 0
        for ray in range(rays * band // BANDS, rays * (band + 1) // BANDS):
            first, direction = starts[ray], directions[ray]
            count = starts[ray + 1] - first
            of_ray[:], steepness_of_ray[:] = 0, 0
            _set_tint(direction, coefficients, monomials, tint_of_ray)
            for n in range(count):
                around(slots, low[first + n], rest[first + n], points[n], corner_weights[n])
                _show(points[n], corner_weights[n], values, direction, tint_of_ray, missing[n])
                for k in range(3):
                    shown = missing[n, k]
                    steepness[n, k] = max(shown * (1 - shown), LEAST_STEEPNESS)
                    missing[n, k] = colors[first + n, k] - shown
                    of_ray[k] += weights[first + n] * missing[n, k]
                    steepness_of_ray[k] += weights[first + n] * steepness[n, k]
            if ray % every == 0:
                _add_equations(monomials, steepness_of_ray, of_ray, equations[band])
            for n in range(count):
                for k in range(3):
                    both = of_samples * missing[n, k] + (1 - of_samples) * of_ray[k]
                    amount[k] = weights[first + n] * both / steepness[n, k]
                _back_project(points[n], corner_weights[n], amount, direction, sums[band])
    return _sum_of_bands(sums), equations.sum(axis=0)


@no_type_check
@compiled(parallel=True)
def totals(slots, low, rest, weights, starts, directions, n_points, of_samples):
    """Returns the sums of the weights by which `residuals` adds to bases and slopes, `points 2`."""
    sums = np.zeros((BANDS, n_points, 2), np.float32)
    rays = len(starts) - 1
    for band in numba.prange(BANDS):
        points, corner_weights = np.empty(8, np.int64), np.empty(8, np.float32)
        for ray in range(rays * band // BANDS, rays * (band + 1) // BANDS):
            samples = slice(starts[ray], starts[ray + 1])
            of_ray, turned = weights[samples].sum(), np.square(directions[ray]).sum()
            for sample in range(starts[ray], starts[ray + 1]):
                around(slots, low[sample], rest[sample], points, corner_weights)
                amount = weights[sample] * (of_samples + (1 - of_samples) * of_ray)
                for corner in range(8):
                    sums[band, points[corner], 0] += amount * corner_weights[corner]
                    sums[band, points[corner], 1] += amount * corner_weights[corner] * turned
    return _sum_of_bands(sums)
