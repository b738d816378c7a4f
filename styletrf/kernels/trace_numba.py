"""Marching rays through an occupancy grid on the CPU, density to weights, forward and backward.

A ray is the grid segment `origin + s * direction`, s in [0, 1], cut into `n_steps` equal steps of
optical length `length / n_steps`. Samples in unoccupied voxels are passed over; a ray ends once its
transmittance falls below `termination`. With optical thickness tau = density x length,

    weight_i = T_i (1 - exp(-tau_i)),   T_{i+1} = T_i - weight_i     (Max 1995, eq. 9)

where 1 - exp(-tau) is taken as -expm1(-tau), exact for thin fog.
"""

import math
from typing import no_type_check

import numba
import numpy as np

from styletrf.kernels.samples import THICKEST
from styletrf.kernels.vm_numba import FAST, ONE, ZERO, vm_sum

MOST = np.float32(THICKEST)


@no_type_check
@numba.njit(cache=True, inline="always")
def _voxel(x, n):
    """Returns the index of the voxel that holds coordinate x, clamped to the grid."""
    position = max(ZERO, (x + ONE) * np.float32(0.5 * n))  # in this order NaN gives 0
    return np.int64(min(position, np.float32(n - 1)))


@no_type_check
@numba.njit(cache=True, inline="always")
def softplus(x):
    """Returns log(1 + exp(x)) without overflow."""
    return max(x, np.float32(0)) + np.float32(math.log1p(math.exp(-abs(x))))


@no_type_check
@numba.njit(cache=True, inline="always")
def sigmoid(x):
    """Returns the derivative of softplus, without overflow."""
    e = np.float32(math.exp(-abs(x)))
    return ONE / (ONE + e) if x >= 0 else e / (ONE + e)


@no_type_check
@numba.njit(cache=True, inline="always")
def _step_thickness(length, n_steps, scale):
    """See `Segments.step_thickness`."""
    length = MOST if length > MOST else length
    thickness = length / np.float32(n_steps) * min(scale, MOST)
    return MOST if thickness > MOST else thickness


@no_type_check
@numba.njit(cache=True, inline="always", fastmath=FAST)
def density_feature(planes, lines, x, y, z):
    """Returns the raw density: the sum over the three axis pairs and their components."""
    return (
        vm_sum(planes[0], lines[0], x, y, z)
        + vm_sum(planes[1], lines[1], x, z, y)
        + vm_sum(planes[2], lines[2], y, z, x)
    )


@no_type_check
@numba.njit(cache=True, parallel=True, fastmath=FAST)
def density_features(positions, planes, lines):
    """Returns the raw density at positions, `n`."""
    out = np.empty(positions.shape[0], np.float32)
    for i in numba.prange(positions.shape[0]):
        out[i] = density_feature(planes, lines, positions[i, 0], positions[i, 1], positions[i, 2])
    return out


@no_type_check
@numba.njit(cache=True, parallel=True, fastmath=FAST)
def trace_forward(
    origins,
    directions,
    lengths,
    n_steps,
    jitter,
    occupancy,
    planes,
    lines,
    shift,
    scale,
    termination,
):
    """Returns the samples of every ray in padded rows: count, s, raw density, weight.

    Args:
        origins: Of the segments in grid coordinates, `rays 3`.
        directions: Likewise, from one end to the other.
        lengths: Optical length of each whole segment, in the density's unit of length.
        n_steps: Steps of each ray.
        jitter: Where in each step its sample lies, in [0, 1), one number a ray.
        occupancy: `x y z`, non-zero where density may be.
        planes: Density factors.
        lines: Density factors.
        shift: density = scale * softplus(raw + shift).
        scale: See `shift`.
        termination: Transmittance at which a ray ends.
    """
    n_rays = origins.shape[0]
    capacity = max(n_steps.max(), 1) if n_rays > 0 else 1
    count = np.zeros(n_rays, np.int64)
    along = np.empty((n_rays, capacity), np.float32)
    raw = np.empty((n_rays, capacity), np.float32)
    weight = np.empty((n_rays, capacity), np.float32)
    nx, ny, nz = occupancy.shape
    for ray in numba.prange(n_rays):
        if n_steps[ray] == 0:
            continue
        step = ONE / np.float32(n_steps[ray])
        thickness = _step_thickness(lengths[ray], n_steps[ray], scale)
        transmittance = ONE
        kept = 0
        for k in range(n_steps[ray]):
            s = (np.float32(k) + jitter[ray]) * step
            x = origins[ray, 0] + s * directions[ray, 0]
            y = origins[ray, 1] + s * directions[ray, 1]
            z = origins[ray, 2] + s * directions[ray, 2]
            if occupancy[_voxel(x, nx), _voxel(y, ny), _voxel(z, nz)] == 0:
                continue
            feature = density_feature(planes, lines, x, y, z)
            tau = thickness * softplus(feature + shift)
            w = -transmittance * np.float32(math.expm1(-tau))
            along[ray, kept] = s
            raw[ray, kept] = feature
            weight[ray, kept] = w
            kept += 1
            transmittance -= w
            if transmittance < termination:
                break
        count[ray] = kept
    return count, along, raw, weight


@no_type_check
@numba.njit(cache=True, parallel=True)
def pack(origins, directions, count, along, raw, weight):
    """Returns padded samples packed ray after ray: offsets, ray, s, position, raw, weight."""
    n_rays = count.shape[0]
    offsets = np.zeros(n_rays + 1, np.int64)
    for ray in range(n_rays):
        offsets[ray + 1] = offsets[ray] + count[ray]
    n = offsets[-1]
    ray_of = np.empty(n, np.int64)
    s_of, raw_of, weight_of = (
        np.empty(n, np.float32),
        np.empty(n, np.float32),
        np.empty(n, np.float32),
    )
    positions = np.empty((n, 3), np.float32)
    for ray in numba.prange(n_rays):
        for k in range(count[ray]):
            i = offsets[ray] + k
            ray_of[i] = ray
            s_of[i] = along[ray, k]
            raw_of[i] = raw[ray, k]
            weight_of[i] = weight[ray, k]
            for axis in range(3):
                positions[i, axis] = origins[ray, axis] + along[ray, k] * directions[ray, axis]
    return offsets, ray_of, s_of, positions, raw_of, weight_of


@no_type_check
@numba.njit(cache=True, parallel=True, fastmath=FAST)
def trace_backward(offsets, lengths, n_steps, raw, weight, grad_weight, shift, scale):
    """Returns the gradient of the raw densities from that of the weights, `n x 1`.

    dL/dtau_i = g_i T_{i+1} - sum_{j > i} g_j weight_j.
    """
    grad_raw = np.empty((raw.shape[0], 1), np.float32)
    for ray in numba.prange(offsets.shape[0] - 1):
        behind = np.float64(0)
        for i in range(offsets[ray], offsets[ray + 1]):
            behind += grad_weight[i] * weight[i]
        transmittance = ONE
        for i in range(offsets[ray], offsets[ray + 1]):
            slope = _step_thickness(lengths[ray], n_steps[ray], scale) * sigmoid(raw[i] + shift)
            transmittance -= weight[i]
            behind -= grad_weight[i] * weight[i]
            grad_tau = grad_weight[i] * transmittance - np.float32(behind)
            grad_raw[i, 0] = grad_tau * slope
    return grad_raw


@no_type_check
@numba.njit(cache=True, inline="always", fastmath=FAST)
def _heaviest_of_haze(weight, first, last, threshold):
    """Returns the first heaviest sample of a ray that is opaque by light samples only, else -1."""
    opacity, heaviest = np.float32(0), first
    for i in range(first, last):
        opacity += weight[i]
        if weight[i] > weight[heaviest]:
            heaviest = i
    return heaviest if opacity > threshold and weight[heaviest] <= threshold else -1


@no_type_check
@numba.njit(cache=True, inline="always")
def _is_heavy(weight, threshold):
    """Returns whether a weight is above the threshold, or NaN, so that NaN is seen."""
    return not weight <= threshold


@no_type_check
@numba.njit(cache=True, parallel=True)
def heavy_samples(offsets, weight, threshold):
    """Returns where each ray's kept samples begin, and which samples those are."""
    n_rays = offsets.shape[0] - 1
    kept = np.zeros(n_rays + 1, np.int64)
    haze = np.empty(n_rays, np.int64)
    for ray in numba.prange(n_rays):
        if offsets[ray] == offsets[ray + 1]:
            continue
        haze[ray] = _heaviest_of_haze(weight, offsets[ray], offsets[ray + 1], threshold)
        for i in range(offsets[ray], offsets[ray + 1]):
            kept[ray + 1] += _is_heavy(weight[i], threshold) or i == haze[ray]
    kept = np.cumsum(kept)
    index = np.empty(kept[-1], np.int64)
    for ray in numba.prange(n_rays):
        k = kept[ray]
        for i in range(offsets[ray], offsets[ray + 1]):
            if _is_heavy(weight[i], threshold) or i == haze[ray]:
                index[k] = i
                k += 1
    return kept, index


@no_type_check
@numba.njit(cache=True, parallel=True, fastmath=FAST)
def composite_forward(offsets, weight, values):
    """Returns the weighted sum of the values of each ray's samples, `rays x c`."""
    n_channels = values.shape[1]
    out = np.zeros((offsets.shape[0] - 1, n_channels), np.float32)
    for ray in numba.prange(offsets.shape[0] - 1):
        for i in range(offsets[ray], offsets[ray + 1]):
            for c in range(n_channels):
                out[ray, c] += weight[i] * values[i, c]
    return out
