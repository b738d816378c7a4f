"""Rays against triangles: a bounding volume hierarchy, and compiled traversal.

Kernels are scalar code for numba that releases the interpreter lock, so that threads can share the
work; they carry `no_type_check` because a run-time type check cannot be compiled.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple, no_type_check

import numba
import numpy as np
from jaxtyping import Float, Int

from styletrf.compiled import compiled

_TRIANGLES_PER_LEAF = 6
_STACK = 64
EPSILON = 1e-9

# No kernel meets a NaN, and infinities are kept; sums may be reordered.
kernel = compiled(nogil=True, error_model="numpy", fastmath={"nnan", "nsz", "arcp", "contract"})
exact = compiled(nogil=True)  # of the hierarchy, the same on every processor


@no_type_check
class Hierarchy(NamedTuple):
    """Boxes around triangles; a node is a leaf where its count is positive."""

    bounds: Any  # nodes x (low corner, high corner)
    links: Any  # nodes x (left child, which the right one follows, 0) or (first triangle, how many)
    facets: Any  # triangles, in the order of the leaves, x (corner, edge, edge)


def in_threads(task: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[Any]:
    """Yields `task(item)` in the order of the items, computed on as many threads as numba has."""
    with ThreadPoolExecutor(numba.config.NUMBA_NUM_THREADS) as pool:  # type: ignore[attr-defined]
        yield from pool.map(task, items)


def build_hierarchy(
    vertices: Float[np.ndarray, "vertices 3"], triangles: Int[np.ndarray, "triangles 3"]
) -> tuple[Hierarchy, Int[np.ndarray, " triangles"]]:
    """Returns the hierarchy, split by surface area, and its order of the triangles."""
    corners = vertices[triangles]
    order, boxes, links = _built(corners.min(axis=1), corners.max(axis=1))
    c = corners[order]
    facets = np.concatenate([c[:, 0], c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]], axis=1)
    return Hierarchy(boxes, links, facets), order


@no_type_check
@exact
def _built(low, high):
    """Returns the order of the triangles, and the bounds and links of the nodes."""
    n = len(low)
    order, starts, stops = np.arange(n), np.zeros(2 * n, np.int64), np.full(2 * n, n)
    boxes, links = np.empty((2 * n, 6)), np.zeros((2 * n, 2), np.int64)
    node, nodes = 0, 1
    while node < nodes:
        start, stop = starts[node], stops[node]
        members = order[start:stop].copy()
        for axis in range(3):
            boxes[node, axis] = low[members, axis].min()
            boxes[node, axis + 3] = high[members, axis].max()
        ranks, left = _best_cut(low[members], high[members])
        if left == 0:
            links[node] = start, stop - start
        else:
            order[start:stop] = members[ranks]
            links[node, 0] = nodes
            starts[nodes], stops[nodes] = start, start + left
            starts[nodes + 1], stops[nodes + 1] = start + left, stop
            nodes += 2
        node += 1
    return order, boxes[:nodes].copy(), links[:nodes].copy()


@no_type_check
@exact
def _best_cut(low, high):
    """Returns the order of the members and how many go left, 0 where a leaf is cheaper."""
    n = len(low)
    least, left, best = np.inf, 0, np.arange(n)
    if n <= _TRIANGLES_PER_LEAF:
        return best, left
    for axis in range(3):
        ranks = np.argsort(low[:, axis] + high[:, axis], kind="mergesort")
        of_left = _areas(low[ranks], high[ranks])
        of_right = _areas(low[ranks[::-1]], high[ranks[::-1]])[::-1]
        for size in range(1, n):
            cost = of_left[size - 1] * size + of_right[size] * (n - size)
            if cost < least:
                least, left, best = cost, size, ranks
    return best, left


@no_type_check
@exact
def _areas(low, high):
    """Returns the surface of the boxes around the first 1, 2, ... n members."""
    areas = np.empty(len(low))
    first, last = low[0].copy(), high[0].copy()
    for i in range(len(low)):
        first, last = np.minimum(first, low[i]), np.maximum(last, high[i])
        x, y, z = last - first
        areas[i] = x * y + y * z + z * x
    return areas


@no_type_check
@kernel
def new_stack():
    """Returns working memory for one thread's traversal."""
    return np.empty(_STACK, np.int64)


@no_type_check
@kernel
def _inverse(x):
    return 1.0 / x if x != 0.0 else 1e30


@no_type_check
@kernel
def _entry(bounds, node, ox, oy, oz, ix, iy, iz, limit):
    """Returns where the ray enters a node's box, infinity if it misses it."""
    x0, x1 = (bounds[node, 0] - ox) * ix, (bounds[node, 3] - ox) * ix
    y0, y1 = (bounds[node, 1] - oy) * iy, (bounds[node, 4] - oy) * iy
    z0, z1 = (bounds[node, 2] - oz) * iz, (bounds[node, 5] - oz) * iz
    enter = max(min(x0, x1), min(y0, y1), min(z0, z1), 0.0)
    leave = min(max(x0, x1), max(y0, y1), max(z0, z1), limit)
    return enter if enter <= leave * (1 + 1e-12) else np.inf


@no_type_check
@kernel
def _meet(facets, i, ox, oy, oz, dx, dy, dz):
    """Returns ray parameter and barycentric coordinates (Moeller and Trumbore 1997)."""
    ax, ay, az = facets[i, 3], facets[i, 4], facets[i, 5]
    bx, by, bz = facets[i, 6], facets[i, 7], facets[i, 8]
    px, py, pz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
    det = ax * px + ay * py + az * pz
    if abs(det) < 1e-14:
        return np.inf, 0.0, 0.0
    sx, sy, sz = ox - facets[i, 0], oy - facets[i, 1], oz - facets[i, 2]
    u = (sx * px + sy * py + sz * pz) / det
    if u < -EPSILON or u > 1 + EPSILON:
        return np.inf, 0.0, 0.0
    qx, qy, qz = sy * az - sz * ay, sz * ax - sx * az, sx * ay - sy * ax
    v = (dx * qx + dy * qy + dz * qz) / det
    if v < -EPSILON or u + v > 1 + EPSILON:
        return np.inf, 0.0, 0.0
    t = (bx * qx + by * qy + bz * qz) / det
    return (t if t > EPSILON else np.inf), u, v


@no_type_check
@kernel
def first_hit(tree, stack, ox, oy, oz, dx, dy, dz, any_hit):
    """Returns (parameter, triangle, u, v) of the nearest hit, or (infinity, -1, 0, 0).

    With `any_hit` it returns as soon as something is hit, which is enough for a shadow.
    """
    ix, iy, iz = _inverse(dx), _inverse(dy), _inverse(dz)
    bounds, links, facets = tree.bounds, tree.links, tree.facets
    best, hit, hit_u, hit_v = np.inf, -1, 0.0, 0.0
    stack[0], size = 0, 1
    if _entry(bounds, 0, ox, oy, oz, ix, iy, iz, best) == np.inf:
        size = 0
    while size > 0:
        size -= 1
        node = stack[size]
        first, count = links[node, 0], links[node, 1]
        if count > 0:
            for i in range(first, first + count):
                t, u, v = _meet(facets, i, ox, oy, oz, dx, dy, dz)
                if t < best:
                    best, hit, hit_u, hit_v = t, i, u, v
            if any_hit and hit >= 0:
                break
            continue
        left = _entry(bounds, first, ox, oy, oz, ix, iy, iz, best)
        right = _entry(bounds, first + 1, ox, oy, oz, ix, iy, iz, best)
        near, far = (first, first + 1) if left <= right else (first + 1, first)
        if max(left, right) < np.inf:
            stack[size] = far
            size += 1
        if min(left, right) < np.inf:
            stack[size] = near
            size += 1
    return (best, hit, hit_u, hit_v) if hit >= 0 else (np.inf, -1, 0.0, 0.0)
