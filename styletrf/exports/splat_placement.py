"""Places splats: one in each voxel of the grid that a surface passes through.

The voxels are as large as the number of splats demands. A splat lies at the mean of the voxel's
surface points and extends as they do: flat along a surface, thin across it.
"""

import numpy as np
from jaxtyping import Float, Int64

from styletrf.exports.export_views import SurfacePoints
from styletrf.exports.splats import Splats, splats_of

_EXTENT = 0.6
_PRIOR_POINTS = 4.0
_THINNEST = 0.2  # of the longest axis
_LARGEST, _SMALLEST = 0.01, 2.0  # voxels a lattice point, between which the size is sought
_HALVINGS = 10


def placed_splats(
    points: SurfacePoints,
    points_grid: Float[np.ndarray, "points 3"],
    resolution: tuple[int, int, int],
    most: int,
) -> Splats:
    """Returns at most so many opaque splats.

    Their deviations are 0.6 times those of their points, which a small prior of round splats makes
    defined where points are few.

    Args:
        points: The points that they are to show, in the world.
        points_grid: The same in coordinates of the field's grid.
        resolution: The resolution of the field's lattice, whose proportions voxels have.
        most: The most splats.
    """
    voxel = voxels_of(points_grid, resolution, most)
    counts = np.bincount(voxel).astype(np.float64)
    centers = voxel_means(points.positions, voxel)
    apart = points.positions - centers[voxel]
    sums = np.empty((len(counts), 3, 3))
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        sums[:, i, j] = sums[:, j, i] = np.bincount(voxel, apart[:, i] * apart[:, j])
    footprint = np.bincount(voxel, points.footprints) / counts
    return splats_of(centers, _covariances(sums, counts, footprint))


def voxels_of(
    points_grid: Float[np.ndarray, "points 3"], resolution: tuple[int, int, int], most: int
) -> Int64[np.ndarray, " points"]:
    """Returns the number of each point's voxel, below `most`, in the finest grid that allows it."""
    fraction = (np.clip(points_grid, -1, 1) + 1) / 2 * np.array(resolution)
    low, high = _LARGEST, _SMALLEST
    found = _numbered(fraction * low)
    for _ in range(_HALVINGS):
        middle = (low * high) ** 0.5
        numbers = _numbered(fraction * middle)
        if numbers.max() < most:
            low, found = middle, numbers
        else:
            high = middle
    return found


def voxel_means(
    values: Float[np.ndarray, "points 3"], voxel: Int64[np.ndarray, " points"]
) -> Float[np.ndarray, "voxels 3"]:
    """Returns the mean of the values in each voxel."""
    sums = np.stack([np.bincount(voxel, column) for column in values.T], axis=1)
    means: Float[np.ndarray, "voxels 3"] = sums / np.bincount(voxel)[:, None]
    return means


def _numbered(places: Float[np.ndarray, "points 3"]) -> Int64[np.ndarray, " points"]:
    cell = places.astype(np.int64)
    sides = cell.max(axis=0) + 1
    keys = (cell[:, 0] * sides[1] + cell[:, 1]) * sides[2] + cell[:, 2]
    return np.unique(keys, return_inverse=True)[1].astype(np.int64)


def _covariances(
    sums: Float[np.ndarray, "splats 3 3"],
    counts: Float[np.ndarray, " splats"],
    footprint: Float[np.ndarray, " splats"],
) -> Float[np.ndarray, "splats 3 3"]:
    """Returns positive definite covariances, also of voxels with a single point.

    The prior is as wide, in pixels, as most splats of many points are along their surface.
    """
    many = counts >= max(2 * _PRIOR_POINTS, float(np.median(counts)))
    many = many if many.any() else counts == counts.max()
    wide = np.linalg.eigvalsh(sums[many] / counts[many, None, None])[:, 1:].mean(axis=1)
    usual = max(float(np.median(wide / footprint[many] ** 2)), 0.1)
    prior = _PRIOR_POINTS * usual * footprint**2
    mixed = (sums + prior[:, None, None] * np.eye(3)) / (counts + _PRIOR_POINTS)[:, None, None]
    variances, axes = np.linalg.eigh(mixed)
    variances = np.maximum(variances, _THINNEST**2 * variances[:, 2:])
    covariances: Float[np.ndarray, "splats 3 3"] = (
        _EXTENT**2 * (axes * variances[:, None, :]) @ axes.transpose(0, 2, 1)
    )
    return covariances
