"""Vector-matrix interpolation on the CPU, forward and backward, without races.

Coordinates are grid coordinates in [-1, 1] with the first and last lattice points on the border;
outside they are clamped. Planes are channels-last `[v, u, c]`, lines `[w, c]`, so that the channels
of a cell are one vector load. Arrays are indexed by numbers, never sliced, in the inner loops: a
slice costs numba two atomic operations.

Gradients are scattered with the samples sorted by plane row and the rows dealt out in bands of
about equal work. A band writes to its own rows; the one row it shares with the next band goes to a
halo of its own that is added afterwards. The number of bands is fixed, so the result is the same on
any number of threads.
"""

from typing import no_type_check

import numba
import numpy as np

BANDS = 16
# Reordering sums is allowed; ignoring NaN and infinity is not.
FAST = {"reassoc", "contract", "nsz", "arcp"}
ZERO, ONE = np.float32(0), np.float32(1)


@no_type_check
@numba.njit(cache=True, inline="always", fastmath=FAST)
def cell(x, n):
    """Returns the two lattice indices around coordinate x on n points, and the fraction."""
    # Where one is NaN, min and max return their first argument: x stays NaN, its cell is 0.
    position = (min(max(x, -ONE), ONE) + ONE) * np.float32(0.5) * np.float32(n - 1)
    lower = min(np.int64(max(ZERO, position)), np.int64(max(n - 2, 0)))
    return lower, min(lower + 1, n - 1), position - np.float32(lower)


@no_type_check
@numba.njit(cache=True, inline="always", fastmath=FAST)
def bilinear(fu, fv):
    """Returns the weights of the cell corners (v, u) = 00, 01, 10, 11."""
    return (ONE - fv) * (ONE - fu), (ONE - fv) * fu, fv * (ONE - fu), fv * fu


@no_type_check
@numba.njit(cache=True, inline="always", fastmath=FAST)
def vm_sum(plane, line, u, v, w):
    """Returns the sum over components of plane(u, v) x line(w)."""
    u0, u1, fu = cell(u, plane.shape[1])
    v0, v1, fv = cell(v, plane.shape[0])
    w0, w1, fw = cell(w, line.shape[0])
    w00, w01, w10, w11 = bilinear(fu, fv)
    total = np.float32(0)
    for c in range(plane.shape[2]):
        on_plane = (
            w00 * plane[v0, u0, c]
            + w01 * plane[v0, u1, c]
            + w10 * plane[v1, u0, c]
            + w11 * plane[v1, u1, c]
        )
        total += on_plane * ((ONE - fw) * line[w0, c] + fw * line[w1, c])
    return total


@no_type_check
@numba.njit(cache=True, inline="always", fastmath=FAST)
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
@numba.njit(cache=True, parallel=True, fastmath=FAST)
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
@numba.njit(cache=True)
def _sorted_by_row(positions, axis, n_rows):
    """Returns the samples' order by lower plane row, and where each row starts in it."""
    n = positions.shape[0]
    starts = np.zeros(n_rows + 1, np.int64)
    rows = np.empty(n, np.int32)
    for i in range(n):
        rows[i] = cell(positions[i, axis], n_rows)[0]
        starts[rows[i] + 1] += 1
    starts = np.cumsum(starts)
    fill = starts[:-1].copy()
    order = np.empty(n, np.int32)
    for i in range(n):
        order[fill[rows[i]]] = i
        fill[rows[i]] += 1
    return order, starts


@no_type_check
@numba.njit(cache=True)
def _bands(starts):
    """Returns the first row of each band, so that bands hold about equally many samples."""
    n_rows, n = starts.shape[0] - 1, starts[-1]
    first = np.full(BANDS + 1, n_rows, np.int64)
    first[0] = 0
    for band in range(1, BANDS):
        row = np.searchsorted(starts, n * band // BANDS)
        first[band] = min(max(first[band - 1], row), n_rows)
    return first


@no_type_check
@numba.njit(cache=True, inline="always", fastmath=FAST)
def _add_to_plane(grad_plane, v, u, scale, values, row):
    for c in range(grad_plane.shape[2]):
        grad_plane[v, u, c] += scale * values[row, c]


@no_type_check
@numba.njit(cache=True, inline="always", fastmath=FAST)
def _component_gradients(grad, i, offset, out):
    """Copies sample i's upstream gradient; one number stands for all summed components."""
    for c in range(out.shape[1]):
        out[2, c] = grad[i, offset + c] if offset >= 0 else grad[i, 0]


@no_type_check
@numba.njit(cache=True, inline="always", fastmath=FAST)
def _factor_gradients(plane, line, corners, weights, buffer):
    """Fills buffer[0] with the gradient of the plane's value, buffer[1] with the line's."""
    u0, u1, v0, v1, w0, w1 = corners
    w00, w01, w10, w11, fw = weights
    # One target a loop: nothing can alias, so each loop is vectorised.
    for c in range(plane.shape[2]):
        buffer[0, c] = buffer[2, c] * ((ONE - fw) * line[w0, c] + fw * line[w1, c])
    for c in range(plane.shape[2]):
        on_plane = (
            w00 * plane[v0, u0, c]
            + w01 * plane[v0, u1, c]
            + w10 * plane[v1, u0, c]
            + w11 * plane[v1, u1, c]
        )
        buffer[1, c] = buffer[2, c] * on_plane


@no_type_check
@numba.njit(cache=True, parallel=True, fastmath=FAST)
def scatter_gradients(positions, axes, grad, offset, plane, line):
    """Returns the gradients of one axis pair's plane and line.

    Args:
        positions: Grid coordinates, `n x 3`.
        axes: The axes of the plane's columns, the plane's rows and the line.
        grad: Upstream gradient of the components, from column `offset` on; with a negative
            offset column 0 holds the gradient of their sum.
        offset: See `grad`.
        plane: The plane, `v u c`.
        line: The line, `w c`.
    """
    n_rows, width, channels = plane.shape
    order, starts = _sorted_by_row(positions, axes[1], n_rows)
    first = _bands(starts)
    grad_plane = np.zeros(plane.shape, np.float32)
    halo = np.zeros((BANDS, width, channels), np.float32)
    grad_lines = np.zeros((BANDS, line.shape[0], channels), np.float32)
    for band in numba.prange(BANDS):
        buffer = np.empty((3, channels), np.float32)
        for k in range(starts[first[band]], starts[first[band + 1]]):
            i = order[k]
            u0, u1, fu = cell(positions[i, axes[0]], width)
            v0, v1, fv = cell(positions[i, axes[1]], n_rows)
            w0, w1, fw = cell(positions[i, axes[2]], line.shape[0])
            w00, w01, w10, w11 = bilinear(fu, fv)
            _component_gradients(grad, i, offset, buffer)
            corners, weights = (u0, u1, v0, v1, w0, w1), (w00, w01, w10, w11, fw)
            _factor_gradients(plane, line, corners, weights, buffer)
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
