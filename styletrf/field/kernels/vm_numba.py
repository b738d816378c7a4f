"""Vector-matrix interpolation on the CPU, forward and backward, without races.

Coordinates are grid coordinates in [-1, 1] with the first and last lattice points on the border;
outside they are clamped. Planes are channels-last `[v, u, c]`, lines `[w, c]`, so that the channels
of a cell are one vector load. Arrays are indexed by numbers, never sliced, in the inner loops: a
slice costs numba two atomic operations.

Gradients are scattered with the rows of a plane dealt out in bands of about equal work. A band
writes to its own rows; the one row it shares with the next band goes to a halo of its own that is
added afterwards. The number of bands is fixed, so the result is the same on any number of threads.
"""

from typing import no_type_check

import numba
import numpy as np

from styletrf.compiled import compiled

BANDS = 16
BLOCK = 64  # samples whose gradients are fetched together
# Reordering sums is allowed; ignoring NaN and infinity is not.
FAST = {"reassoc", "contract", "nsz", "arcp"}
ZERO, ONE = np.float32(0), np.float32(1)


@no_type_check
@compiled(inline="always", fastmath=FAST)
def cell(x, n):
    """Returns the two lattice indices around coordinate x on n points, and the fraction."""
    # Where one is NaN, min and max return their first argument: x stays NaN, its cell is 0.
    position = (min(max(x, -ONE), ONE) + ONE) * np.float32(0.5) * np.float32(n - 1)
    lower = min(np.int64(max(ZERO, position)), np.int64(max(n - 2, 0)))
    return lower, min(lower + 1, n - 1), position - np.float32(lower)


@no_type_check
@compiled(inline="always", fastmath=FAST)
def bilinear(fu, fv):
    """Returns the weights of the cell corners (v, u) = 00, 01, 10, 11."""
    return (ONE - fv) * (ONE - fu), (ONE - fv) * fu, fv * (ONE - fu), fv * fu


@no_type_check
@compiled(inline="always", fastmath=FAST)
def vm_sum(plane, line, u, v, w):
    """Returns the sum over components of plane(u, v) x line(w)."""
    u0, u1, fu = cell(u, plane.shape[1])
    v0, v1, fv = cell(v, plane.shape[0])
    w0, w1, fw = cell(w, line.shape[0])
    corners, weights = (u0, u1, v0, v1, w0, w1), (*bilinear(fu, fv), fw)
    # With a number for the rank its loop has no remainder to care for: a sixth of a march's time.
    if plane.shape[2] == 16:
        return _sum_of_products(plane, line, corners, weights, 16)
    if plane.shape[2] == 8:
        return _sum_of_products(plane, line, corners, weights, 8)
    if plane.shape[2] == 4:
        return _sum_of_products(plane, line, corners, weights, 4)
    return _sum_of_products(plane, line, corners, weights, plane.shape[2])


@no_type_check
@compiled(inline="always", fastmath=FAST)
def _sum_of_products(plane, line, corners, weights, rank):
    u0, u1, v0, v1, w0, w1 = corners
    w00, w01, w10, w11, fw = weights
    total = np.float32(0)
    for c in range(rank):
        on_plane = (
            w00 * plane[v0, u0, c]
            + w01 * plane[v0, u1, c]
            + w10 * plane[v1, u0, c]
            + w11 * plane[v1, u1, c]
        )
        total += on_plane * ((ONE - fw) * line[w0, c] + fw * line[w1, c])
    return total


@no_type_check
@compiled(inline="always", fastmath=FAST)
def _vm_products(plane, line, u, v, w, out, i, offset):
    """Writes plane(u, v) x line(w) of every component to `out[i, offset:]`."""
    u0, u1, fu = cell(u, plane.shape[1])
    v0, v1, fv = cell(v, plane.shape[0])
    w0, w1, fw = cell(w, line.shape[0])
    w00, w01, w10, w11 = bilinear(fu, fv)
    for c in range(plane.shape[2]):
        on_plane = (
            w00 * plane[v0, u0, c]
            + w01 * plane[v0, u1, c]
            + w10 * plane[v1, u0, c]
            + w11 * plane[v1, u1, c]
        )
        out[i, offset + c] = on_plane * ((ONE - fw) * line[w0, c] + fw * line[w1, c])


@no_type_check
@compiled(parallel=True, fastmath=FAST)
def features_forward(positions, plane0, plane1, plane2, line0, line1, line2):
    """Returns the products of all components of the three axis pairs, `n x (c0 + c1 + c2)`."""
    c0 = plane0.shape[2]
    c1 = c0 + plane1.shape[2]
    out = np.empty((positions.shape[0], c1 + plane2.shape[2]), np.float32)
    for i in numba.prange(positions.shape[0]):
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        _vm_products(plane0, line0, x, y, z, out, i, 0)
        _vm_products(plane1, line1, x, z, y, out, i, c0)
        _vm_products(plane2, line2, y, z, x, out, i, c1)
    return out


@no_type_check
@compiled()
def nonzero_rows(grad):
    """Returns the samples whose gradient is not zero: the others touch no factor."""
    n, count = grad.shape[0], 0
    samples = np.empty(n, np.int32)
    for i in range(n):
        for c in range(grad.shape[1]):
            if grad[i, c] != ZERO:
                samples[count] = i
                count += 1
                break
    return samples[:count]


@no_type_check
@compiled()
def _bands(positions, samples, axis, n_rows):
    """Returns each band's first row and, band after band in their order, the samples of its rows.

    Bands hold about equally many samples, and `starts` says where theirs begin. Those of a ray stay
    together: they mostly touch the same cells, and their gradients lie side by side.
    """
    n = samples.shape[0]
    counts = np.zeros(n_rows, np.int64)
    rows = np.empty(n, np.int32)
    for k in range(n):
        rows[k] = cell(positions[samples[k], axis], n_rows)[0]
        counts[rows[k]] += 1
    ends = np.cumsum(counts)
    band_of_row = np.minimum((ends - counts) * BANDS // max(n, 1), BANDS - 1)
    first = np.searchsorted(band_of_row, np.arange(BANDS + 1))
    starts = np.zeros(BANDS + 1, np.int64)
    for band in range(BANDS):
        starts[band + 1] = ends[first[band + 1] - 1] if first[band + 1] > 0 else 0
    fill = starts[:-1].copy()
    order = np.empty(n, np.int32)
    for k in range(n):
        band = band_of_row[rows[k]]
        order[fill[band]] = samples[k]
        fill[band] += 1
    return first, starts, order


@no_type_check
@compiled(inline="always", fastmath=FAST)
def _add_to_plane(grad_plane, v, u, scale, values, row):
    for c in range(grad_plane.shape[2]):
        grad_plane[v, u, c] += scale * values[row, c]


@no_type_check
@compiled(inline="always", fastmath=FAST)
def _component_gradients(grad, order, first, last, offset, out):
    """Copies the upstream gradients of some samples; one number stands for all summed components.

    They lie far apart: fetched in one short loop, many are under way at a time.
    """
    for k in range(first, last):
        for c in range(out.shape[1]):
            out[k - first, c] = grad[order[k], offset + c] if offset >= 0 else grad[order[k], 0]


@no_type_check
@compiled(inline="always", fastmath=FAST)
def _factor_gradients(plane, line, corners, weights, upstream, k, buffer):
    """Fills buffer[0] with the gradient of the plane's value, buffer[1] with the line's."""
    u0, u1, v0, v1, w0, w1 = corners
    w00, w01, w10, w11, fw = weights
    # One target a loop: nothing can alias, so each loop is vectorized.
    for c in range(plane.shape[2]):
        buffer[0, c] = upstream[k, c] * ((ONE - fw) * line[w0, c] + fw * line[w1, c])
    for c in range(plane.shape[2]):
        on_plane = (
            w00 * plane[v0, u0, c]
            + w01 * plane[v0, u1, c]
            + w10 * plane[v1, u0, c]
            + w11 * plane[v1, u1, c]
        )
        buffer[1, c] = upstream[k, c] * on_plane


@no_type_check
@compiled(parallel=True, fastmath=FAST)
def scatter_gradients(positions, samples, axes, grad, offset, plane, line):
    """Returns the gradients of one axis pair's plane and line.

    Args:
        positions: Grid coordinates, `n x 3`.
        samples: Those that have a gradient, see `nonzero_rows`.
        axes: The axes of the plane's columns, the plane's rows and the line.
        grad: Upstream gradient of the components, from column `offset` on; with a negative
            offset column 0 holds the gradient of their sum.
        offset: See `grad`.
        plane: The plane, `v u c`.
        line: The line, `w c`.
    """
    n_rows, width, channels = plane.shape
    first, starts, order = _bands(positions, samples, axes[1], n_rows)
    grad_plane = np.empty(plane.shape, np.float32)
    halo = np.empty((BANDS, width, channels), np.float32)
    grad_lines = np.empty((BANDS, line.shape[0], channels), np.float32)
    for band in numba.prange(BANDS):
        grad_plane[first[band] : first[band + 1]] = 0  # by all threads, and into their caches
        halo[band], grad_lines[band] = 0, 0
        buffer = np.empty((2, channels), np.float32)
        upstream = np.empty((BLOCK, channels), np.float32)
        for start in range(starts[band], starts[band + 1], BLOCK):
            end = min(start + BLOCK, starts[band + 1])
            _component_gradients(grad, order, start, end, offset, upstream)
            for k in range(start, end):
                i = order[k]
                u0, u1, fu = cell(positions[i, axes[0]], width)
                v0, v1, fv = cell(positions[i, axes[1]], n_rows)
                w0, w1, fw = cell(positions[i, axes[2]], line.shape[0])
                w00, w01, w10, w11 = bilinear(fu, fv)
                corners, weights = (u0, u1, v0, v1, w0, w1), (w00, w01, w10, w11, fw)
                _factor_gradients(plane, line, corners, weights, upstream, k - start, buffer)
                _add_to_plane(grad_plane, v0, u0, w00, buffer, 0)
                _add_to_plane(grad_plane, v0, u1, w01, buffer, 0)
                if v1 < first[band + 1]:
                    _add_to_plane(grad_plane, v1, u0, w10, buffer, 0)
                    _add_to_plane(grad_plane, v1, u1, w11, buffer, 0)
                else:
                    _add_to_plane(halo, band, u0, w10, buffer, 0)
                    _add_to_plane(halo, band, u1, w11, buffer, 0)
                _add_to_plane(grad_lines, band, w0, ONE - fw, buffer, 1)
                _add_to_plane(grad_lines, band, w1, fw, buffer, 1)
    for band in range(BANDS):
        if first[band] < first[band + 1] < n_rows:
            grad_plane[first[band + 1]] += halo[band]
    return grad_plane, grad_lines.sum(axis=0)
