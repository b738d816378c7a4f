"""How far from anything occupied a voxel lies, so that a ray can pass over what is empty."""

from typing import no_type_check

import numba
import numpy as np

FARTHEST = 64


@no_type_check
@numba.njit(cache=True)
def clearance(occupied):
    """Returns 1 where `x y z` is occupied, elsewhere the distance k to what is, 0 for a neighbour.

    The distance is the largest difference of indices along any axis (Chebyshev's), at most 64; two
    sweeps over the grid, there and back, find it exactly (Rosenfeld and Pfaltz 1968).
    """
    nx, ny, nz = occupied.shape
    far = np.where(occupied, np.uint8(0), np.uint8(FARTHEST))
    for x in range(nx):
        for y in range(ny):
            for z in range(nz):
                _lower(far, x, y, z, -1)
    for x in range(nx - 1, -1, -1):
        for y in range(ny - 1, -1, -1):
            for z in range(nz - 1, -1, -1):
                _lower(far, x, y, z, 1)
    for x in range(nx):
        for y in range(ny):
            for z in range(nz):
                far[x, y, z] = 1 - far[x, y, z] if far[x, y, z] < 2 else far[x, y, z]
    return far


@no_type_check
@numba.njit(cache=True, inline="always")
def _lower(far, x, y, z, back):
    """Lowers a voxel's distance to one more than that of the neighbours already swept."""
    nx, ny, nz = far.shape
    nearest = far[x, y, z]
    if nearest == 0:
        return
    for i in range(-1, 2):
        for j in range(-1, 2):
            for k in range(-1, 2):
                if (i * 9 + j * 3 + k) * back <= 0:
                    continue
                u, v, w = x + i, y + j, z + k
                if 0 <= u < nx and 0 <= v < ny and 0 <= w < nz:
                    nearest = min(nearest, far[u, v, w] + 1)
    far[x, y, z] = nearest
