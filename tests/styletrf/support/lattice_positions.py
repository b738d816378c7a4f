"""Places in a lattice of bricks."""

import numpy as np

from styletrf.viewer.lattice import SIDE, BrickLattice


def positions_in(occupied: np.ndarray, seed: int) -> np.ndarray:
    """Positions of the grid in occupied voxels, their corners among them."""
    voxels = np.argwhere(occupied)
    within = np.random.default_rng(seed).random((len(voxels), 4, 3))
    within[:, 0], within[:, 1] = 0, 1
    return ((voxels[:, None] + within) / occupied.shape * 2 - 1).reshape(-1, 3)


def addresses(lattice: BrickLattice, points: np.ndarray) -> np.ndarray:
    """Where the values of lattice points are stored; -1 where they are not."""
    brick, local = np.divmod(points, SIDE)
    slot = lattice.slots[tuple(brick.T)]
    return np.where(slot < 0, -1, slot * SIDE**3 + local @ [1, SIDE, SIDE * SIDE])


def corners(lattice: BrickLattice, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The addresses and the trilinear weights of the 8 points around each position."""
    low, high_fraction = lattice.cells(positions)
    of_points, weights = [], []
    for corner in np.indices((2, 2, 2)).reshape(3, -1).T:
        of_points.append(addresses(lattice, low + corner))
        weights.append(np.where(corner == 1, high_fraction, 1 - high_fraction).prod(axis=1))
    return np.stack(of_points, axis=1), np.stack(weights, axis=1)
