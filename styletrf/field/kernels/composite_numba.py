"""Compositing along rays on the CPU, and choosing the samples worth a color."""

from typing import no_type_check

import numba
import numpy as np

from styletrf.compiled import compiled
from styletrf.field.kernels.vm_numba import FAST


@no_type_check
@compiled(inline="always", fastmath=FAST)
def _heaviest_of_faint_ray(weight, first, last, threshold):
    """Returns the first heaviest of a ray's light samples if it is opaque by them, else -1."""
    opacity, heaviest = np.float32(0), first
    for i in range(first, last):
        opacity += weight[i]
        if weight[i] > weight[heaviest]:
            heaviest = i
    return heaviest if opacity > threshold else -1


@no_type_check
@compiled(inline="always")
def _is_heavy(weight, threshold):
    """Returns whether a weight is above the threshold, or NaN, so that NaN is seen."""
    return not weight <= threshold


@no_type_check
@compiled(parallel=True)
def heavy_samples(offsets, weight, threshold):
    """Returns where each ray's kept samples begin, and which samples those are."""
    n_rays = offsets.shape[0] - 1
    kept = np.zeros(n_rays + 1, np.int64)
    heaviest = np.empty(n_rays, np.int64)
    for ray in numba.prange(n_rays):
        first, end, n_heavy = offsets[ray], offsets[ray + 1], 0
        for i in range(first, end):
            n_heavy += _is_heavy(weight[i], threshold)
        heaviest[ray] = -1
        if n_heavy == 0 and first < end:
            heaviest[ray] = _heaviest_of_faint_ray(weight, first, end, threshold)
        kept[ray + 1] = n_heavy + (heaviest[ray] >= 0)
    kept = np.cumsum(kept)
    index = np.empty(kept[-1], np.int64)
    for ray in numba.prange(n_rays):
        k = kept[ray]
        if heaviest[ray] >= 0:
            index[k] = heaviest[ray]
            continue
        for i in range(offsets[ray], offsets[ray + 1]):
            if k == kept[ray + 1]:
                break
            if _is_heavy(weight[i], threshold):
                index[k] = i
                k += 1
    return kept, index


@no_type_check
@compiled(parallel=True, fastmath=FAST)
def composite_forward(offsets, weight, values):
    """Returns the weighted sum of the values of each ray's samples, `rays x c`."""
    n_channels = values.shape[1]
    out = np.zeros((offsets.shape[0] - 1, n_channels), np.float32)
    for ray in numba.prange(offsets.shape[0] - 1):
        for i in range(offsets[ray], offsets[ray + 1]):
            for c in range(n_channels):
                out[ray, c] += weight[i] * values[i, c]
    return out


@no_type_check
@compiled(parallel=True, fastmath=FAST)
def composite_backward(ray, weight, values, grad):
    """Returns the gradients of the weights and of the values from that of the sums."""
    n, n_channels = values.shape
    grad_weight = np.empty(n, np.float32)
    grad_values = np.empty((n, n_channels), np.float32)
    for i in numba.prange(n):
        total = np.float32(0)
        for c in range(n_channels):
            total += grad[ray[i], c] * values[i, c]
            grad_values[i, c] = weight[i] * grad[ray[i], c]
        grad_weight[i] = total
    return grad_weight, grad_values
