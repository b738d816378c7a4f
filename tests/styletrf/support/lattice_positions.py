"""Places in a lattice of bricks."""

import numpy as np


def positions_in(occupied: np.ndarray, seed: int) -> np.ndarray:
    """Positions of the grid in occupied voxels, their corners among them."""
    voxels = np.argwhere(occupied)
    within = np.random.default_rng(seed).random((len(voxels), 4, 3))
    within[:, 0], within[:, 1] = 0, 1
    return ((voxels[:, None] + within) / occupied.shape * 2 - 1).reshape(-1, 3)
