"""Marching rays through an occupancy grid on the CPU, density to weights, forward and backward.

A ray is a chain of straight pieces of the grid, by s in [0, 1], cut into `n_steps` equal steps of
optical length `length / n_steps`. Samples in unoccupied voxels are passed over; a ray ends once its
transmittance falls below `termination`. With optical thickness tau = density x length,

    weight_i = T_i (1 - exp(-tau_i)),   T_{i+1} = T_i - weight_i     (Max 1995, eq. 9)

where 1 - exp(-tau) is taken as -expm1(-tau), exact for thin fog.
"""

import math
from typing import no_type_check

import numba
import numpy as np

from styletrf.compiled import compiled
from styletrf.field.kernels.vm_numba import FAST, ONE, ZERO, vm_sum

RAYS = 64  # of a block, whose samples one thread finds


@no_type_check
@compiled(inline="always")
def _voxel(x, n):
    """Returns the index of the voxel that holds coordinate x, clamped to the grid."""
    position = max(ZERO, (x + ONE) * np.float32(0.5 * n))  # in this order NaN gives 0
    return np.int64(min(position, np.float32(n - 1)))


@no_type_check
@compiled(inline="always")
def softplus(x):
    """Returns log(1 + exp(x)) without overflow."""
    return max(x, np.float32(0)) + np.float32(math.log1p(math.exp(-abs(x))))


@no_type_check
@compiled(inline="always")
def sigmoid(x):
    """Returns the derivative of softplus, without overflow."""
    e = np.float32(math.exp(-abs(x)))
    return ONE / (ONE + e) if x >= 0 else e / (ONE + e)


@no_type_check
@compiled(inline="always", fastmath=FAST)
def density_feature(planes, lines, x, y, z):
    """Returns the raw density: the sum over the three axis pairs and their components."""
    return (
        vm_sum(planes[0], lines[0], x, y, z)
        + vm_sum(planes[1], lines[1], x, z, y)
        + vm_sum(planes[2], lines[2], y, z, x)
    )


@no_type_check
@compiled(parallel=True, fastmath=FAST)
def density_features(positions, planes, lines):
    """Returns the raw density at positions, `n`."""
    out = np.empty(positions.shape[0], np.float32)
    for i in numba.prange(positions.shape[0]):
        out[i] = density_feature(planes, lines, positions[i, 0], positions[i, 1], positions[i, 2])
    return out


@no_type_check
@compiled()
def _firsts(n):
    """Returns where blocks of rays with so many samples begin, and where the last ends."""
    n_blocks = (n.shape[0] + RAYS - 1) // RAYS
    first = np.zeros(n_blocks + 1, np.int64)
    for ray in range(n.shape[0]):
        first[ray // RAYS + 1] += n[ray]
    return np.cumsum(first)


@no_type_check
@compiled(parallel=True, fastmath=FAST)
def trace_forward(
    origins, directions, ends, thickness, n_steps, jitter, occupancy, planes, lines, shift,
    termination,
):  # fmt: skip
    """Returns how many samples rays have, and these, loosely packed; see `pack`.

    They are the s of the samples, the arguments of their softplus, and their weights. A block of
    rays begins where all steps of the blocks before it would end, and its samples follow one
    another: so threads need not wait for each other, and little memory is touched.

    Args:
        origins: The origins of the pieces in grid coordinates, `rays pieces 3`, see `RaySegments`.
        directions: The directions of the pieces, likewise.
        ends: The ends of the pieces, `rays pieces`.
        thickness: See `RaySegments.step_thickness`.
        n_steps: Steps of each ray.
        jitter: Where in each step its sample lies, in [0, 1), one number a ray.
        occupancy: `x y z`, non-zero where density may be.
        planes: Density factors.
        lines: Density factors.
        shift: Added to the raw density; tau = thickness * softplus(raw + shift).
        termination: Transmittance at which a ray ends.
    """
    n_rays = origins.shape[0]
    first = _firsts(n_steps)
    count = np.zeros(n_rays, np.int64)
    along = np.empty(first[-1], np.float32)
    argument, weight = np.empty_like(along), np.empty_like(along)
    nx, ny, nz = occupancy.shape
    last = ends.shape[1] - 1
    for block in numba.prange(first.shape[0] - 1):
        at = first[block]
        for ray in range(block * RAYS, min((block + 1) * RAYS, n_rays)):
            if n_steps[ray] == 0:
                continue
            step = ONE / np.float32(n_steps[ray])
            transmittance = ONE
            begin, piece = at, 0
            for k in range(n_steps[ray]):
                s = (np.float32(k) + jitter[ray]) * step
                while piece < last and s > ends[ray, piece]:
                    piece += 1
                x = origins[ray, piece, 0] + s * directions[ray, piece, 0]
                y = origins[ray, piece, 1] + s * directions[ray, piece, 1]
                z = origins[ray, piece, 2] + s * directions[ray, piece, 2]
                if occupancy[_voxel(x, nx), _voxel(y, ny), _voxel(z, nz)] == 0:
                    continue
                shifted = density_feature(planes, lines, x, y, z) + shift
                tau = thickness[ray] * softplus(shifted)
                w = -transmittance * np.float32(math.expm1(-tau))
                along[at], argument[at], weight[at] = s, shifted, w
                at += 1
                transmittance -= w
                if transmittance < termination:
                    break
            count[ray] = at - begin
    return count, along, argument, weight


@no_type_check
@compiled(parallel=True)
def pack(origins, directions, ends, n_steps, count, along, argument, weight):
    """Returns samples packed ray after ray: offsets, ray, s, position, weight, argument."""
    n_rays = count.shape[0]
    offsets = np.zeros(n_rays + 1, np.int64)
    for ray in range(n_rays):
        offsets[ray + 1] = offsets[ray] + count[ray]
    n = offsets[-1]
    ray_of = np.empty(n, np.int64)
    s_of, weight_of = np.empty(n, np.float32), np.empty(n, np.float32)
    argument_of = np.empty(n, np.float32)
    positions = np.empty((n, 3), np.float32)
    last = ends.shape[1] - 1
    first = _firsts(n_steps)
    for block in numba.prange(first.shape[0] - 1):
        shift = first[block] - offsets[block * RAYS]
        for ray in range(block * RAYS, min((block + 1) * RAYS, n_rays)):
            piece = 0
            for i in range(offsets[ray], offsets[ray + 1]):
                s = along[i + shift]
                while piece < last and s > ends[ray, piece]:
                    piece += 1
                ray_of[i] = ray
                s_of[i] = s
                weight_of[i] = weight[i + shift]
                argument_of[i] = argument[i + shift]
                for axis in range(3):
                    direction = directions[ray, piece, axis]
                    positions[i, axis] = origins[ray, piece, axis] + s * direction
    return offsets, ray_of, s_of, positions, weight_of, argument_of


@no_type_check
@compiled(parallel=True, fastmath=FAST)
def trace_backward(offsets, weight, argument, thickness, grad):
    """Returns the gradient of the raw densities from that of the weights.

    dL/dtau_i = g_i T_{i+1} - sum_{j > i} g_j weight_j.
    """
    grad_raw = np.empty_like(weight)
    for ray in numba.prange(offsets.shape[0] - 1):
        behind = np.float64(0)
        for i in range(offsets[ray], offsets[ray + 1]):
            behind += grad[i] * weight[i]
        transmittance = ONE
        for i in range(offsets[ray], offsets[ray + 1]):
            transmittance -= weight[i]
            behind -= grad[i] * weight[i]
            grad_tau = grad[i] * transmittance - np.float32(behind)
            grad_raw[i] = grad_tau * thickness[ray] * sigmoid(argument[i])
    return grad_raw
