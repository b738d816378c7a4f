"""The part of a dense lattice that rays can meet, in bricks of 8 x 8 x 8 points.

A field's components are bilinear on planes and linear on lines, so their sum is the trilinear
interpolation of its values at lattice points (docs/viewer.md): these are all that a viewer needs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int32, Int64, Shaped, UInt8

SIDE = 8
"""Points of a brick along each axis; a lattice's last bricks may reach beyond its points."""
MOST_BRICKS = 32**3
"""With the layer that each shares with the next they fill a texture of 288^3 texels: 96 MB."""


@dataclass(frozen=True, slots=True)
class BrickLattice:
    """The stored bricks of a lattice, in their order.

    Attributes:
        resolution: The points along x, y, z; the first and the last lie on the grid's borders.
        slots: The number of each brick, counted with x fastest; -1 where none is stored.
        needed: Which of the stored points matter, `bricks` x 512, x fastest.
    """

    resolution: tuple[int, int, int]
    slots: Int32[np.ndarray, "x y z"]
    needed: Bool[np.ndarray, "bricks 512"]

    @property
    def n_bricks(self) -> int:
        """The number of stored bricks."""
        return len(self.needed)

    def bricks(self) -> Int64[np.ndarray, "bricks 3"]:
        """Returns which brick is stored in each slot."""
        found: Int64[np.ndarray, "bricks 3"] = np.argwhere(self.slots.transpose(2, 1, 0) >= 0)
        return found[:, ::-1]

    def points(self) -> Int64[np.ndarray, "points 3"]:
        """Returns the indices of all stored points, brick by brick; on the border if beyond it."""
        z, y, x = np.indices((SIDE,) * 3).reshape(3, -1)
        local = np.stack([x, y, z], axis=1)
        points = (SIDE * self.bricks()[:, None] + local).reshape(-1, 3)
        within: Int64[np.ndarray, "points 3"] = np.minimum(points, np.array(self.resolution) - 1)
        return within

    def cells(
        self, positions: Float[np.ndarray, "samples 3"]
    ) -> tuple[Int64[np.ndarray, "samples 3"], Float[np.ndarray, "samples 3"]]:
        """Returns the lowest of the points around grid positions, and where between them these are.

        Positions outside the grid count as on its border.
        """
        last = np.array(self.resolution) - 1
        at = np.clip((positions + 1) / 2 * last, 0, last)
        low = np.minimum(at.astype(np.int64), last - 1)
        return low, at - low


def brick_lattice(
    cells: Bool[np.ndarray, "cells_x cells_y cells_z"], resolution: Sequence[int]
) -> BrickLattice:
    """Returns the lattice of those points that samples in the cells interpolate between."""
    x, y, z = resolution
    blocks = _greatest_by_bricks(cells)
    present = blocks.any(axis=3)
    slots = np.where(present, np.cumsum(present).reshape(present.shape) - 1, -1)
    by_axes = np.ascontiguousarray(slots.transpose(2, 1, 0), np.int32)
    return BrickLattice((x, y, z), by_axes, blocks[present])


def _greatest_by_bricks(
    cells: Shaped[np.ndarray, "cells_x cells_y cells_z"],
) -> Shaped[np.ndarray, "bricks_z bricks_y bricks_x 512"]:
    """Returns the greatest of the values in the cells around each point, by bricks."""
    greatest = cells
    for axis in range(3):  # a point has cells on both of its sides
        lower, upper = ([(0, 0)] * axis + [pad] + [(0, 0)] * (2 - axis) for pad in ((0, 1), (1, 0)))
        greatest = np.maximum(np.pad(greatest, lower), np.pad(greatest, upper))
    blocks = np.pad(greatest, [(0, -n % SIDE) for n in greatest.shape])
    bx, by, bz = (n // SIDE for n in blocks.shape)
    blocks = blocks.reshape(bx, SIDE, by, SIDE, bz, SIDE).transpose(4, 2, 0, 5, 3, 1)
    return blocks.reshape(bz, by, bx, SIDE**3)


def occupied_cells(
    occupancy: Shaped[np.ndarray, "x y z"], resolution: Sequence[int]
) -> Bool[np.ndarray, "cells_x cells_y cells_z"]:
    """Returns the lattice's cells with a part occupied."""
    return greatest_in_cells(occupancy != 0, resolution)


def greatest_in_cells(
    voxels: Shaped[np.ndarray, "x y z"], resolution: Sequence[int]
) -> Shaped[np.ndarray, "cells_x cells_y cells_z"]:
    """Returns the greatest value of a voxel in each cell: one less than points along each axis.

    Voxels fill the grid from border to border, whatever the ratio of their number to that of the
    points.
    """
    cells = voxels
    for axis, points in enumerate(resolution):
        side = voxels.shape[axis]
        bounds = np.arange(points) * (side / (points - 1))
        first = np.floor(bounds[:-1] - 1e-9).clip(0, side - 1).astype(np.int64)
        last = np.ceil(bounds[1:] + 1e-9).clip(1, side).astype(np.int64) - 1
        found = cells.take(first, axis)
        for further in range(1, int((last - first).max()) + 1):
            found = np.maximum(found, cells.take(np.minimum(first + further, last), axis))
        cells = found
    return cells


def empty_distances(
    occupancy: UInt8[np.ndarray, "x y z"], most: int = 15
) -> UInt8[np.ndarray, "x y z"]:
    """Returns how many voxels away the nearest occupied one is, along the axis where it is most.

    0 is an occupied voxel; `most` is that distance or a longer one. All voxels whose indices differ
    by less are empty, so a ray may leap over them.
    """
    near = occupancy != 0
    distances = np.where(near, 0, most).astype(np.uint8)
    for distance in range(1, most):
        near = grown(near)
        distances[near & (distances == most)] = distance
    return distances


def grown(mask: Bool[np.ndarray, "x y z"]) -> Bool[np.ndarray, "x y z"]:
    """Returns the mask with all 26 neighbors of its points."""
    for axis in range(3):
        wider = mask.copy()
        ahead, behind = ([slice(None)] * 3 for _ in range(2))
        ahead[axis], behind[axis] = slice(1, None), slice(None, -1)
        wider[tuple(ahead)] |= mask[tuple(behind)]
        wider[tuple(behind)] |= mask[tuple(ahead)]
        mask = wider
    return mask
