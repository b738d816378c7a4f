"""Decides whether the exposures of photographs differ so much that each needs its own.

The points are divided into two halves, and the exposures are estimated from each half alone. An
exposure changes both halves alike; noise, and shading that depends on the view, change each its own
way. So with d the change of a log color in a view,

    spread^2 = mean of d_first d_second        over views, channels and levels of brightness

is free of the disagreement of the halves, which half the mean of (d_first - d_second)^2 measures.
The halves are the fields of a chessboard of blocks, or lie on either side of the middle along one
of the three principal axes: sheen on a table is in both halves of some of these, but not of all,
and those that agree least count.
Photographs of different sizes come from different cameras, which rarely expose alike. Less
agreement is needed there.
From d the mean of the views that share the most points is subtracted: a field shows slow changes
along the way, such as the sheen of surfaces, by colors that depend on the view (decision 20).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from styletrf.geometry.cameras import Camera
from styletrf.geometry.point_table import SparsePoints
from styletrf.scene.exposures import Exposure, Exposures, estimate_exposures

LEAST_SPREAD = 0.05  # of log colors: 2 % of the range at mid-gray, an error of 34 dB
LEAST_RATIO = 1.25  # of the spread to the disagreement: sheen alone has up to 1.1 (decision 20)
LEAST_RATIO_OF_SEVERAL_CAMERAS = 1.0  # likewise, of photographs by several cameras
_SAME_SIZE = 1.05  # ratio of the longer sides of one camera's photographs
_NEIGHBORS = 4  # of a view, that predict its exposure
_BLOCKS = 2  # along each axis
_NEAR = 5.0  # median distances from the middle, of the points that decide the principal axes
_NO_SPREAD = 1e-9
_LEVELS = 0.1, 0.5, 0.9  # quantiles of the brightness at which changes are compared


@dataclass(frozen=True, slots=True)
class ExposureEvidence:
    """The spread of log colors that the halves agree on, and the spread of their disagreement.

    `exposures` are those estimated from all points together, by the photograph's name.
    `several_cameras` says whether the photographs have different sizes.
    """

    spread: float
    disagreement: float
    exposures: dict[str, Exposure]
    several_cameras: bool = False

    @property
    def least_ratio(self) -> float:
        """The ratio of the spread to the disagreement that is needed."""
        return LEAST_RATIO_OF_SEVERAL_CAMERAS if self.several_cameras else LEAST_RATIO

    @property
    def needed(self) -> bool:
        """Whether photographs need exposures of their own."""
        return self.spread >= max(LEAST_SPREAD, self.least_ratio * self.disagreement)


def taken_by_several(long_sides_px: Sequence[int]) -> bool:
    """Returns whether photographs come from several cameras, by their longer sides as they came.

    Photographs that are reduced to one size say nothing of their cameras.
    """
    return max(long_sides_px, default=0) > _SAME_SIZE * min(long_sides_px, default=0)


def exposure_evidence(
    points: SparsePoints,
    log_color: Float[np.ndarray, "observations 3"],
    cameras: Sequence[Camera],
    *,
    several_cameras: bool = False,
) -> ExposureEvidence:
    """Returns the evidence in the tracks of the points.

    Args:
        points: The points with their tracks, of the views that a field is fitted to.
        log_color: The log color of each observation; NaN where saturated.
        cameras: The cameras, in the order in which `points` counts images.
        several_cameras: See `taken_by_several`.
    """
    views = len(cameras)
    named = _named(cameras, estimate_exposures(points, log_color, views))
    known = log_color[~np.isnan(log_color)]
    if not len(known) or views < 2:
        return ExposureEvidence(0.0, 0.0, named)
    levels, beside = np.quantile(known, _LEVELS), _beside(points, views)
    found = []
    for first in _halves(points):
        changes = (
            estimate_exposures(
                points, np.where(half[points.observed_point][:, None], log_color, np.nan), views
            ).log_change(levels)
            for half in (first, ~first)
        )
        a, b = (change - change[beside].mean(axis=1) for change in changes)
        shared, apart = float((a * b).mean()), float(((a - b) ** 2).mean()) / 2
        found.append((max(shared, 0.0) ** 0.5, apart**0.5))
    spread, disagreement = min(found, key=lambda one: one[0] / max(one[1], _NO_SPREAD))
    return ExposureEvidence(spread, disagreement, named, several_cameras)


def _named(cameras: Sequence[Camera], exposures: Exposures) -> dict[str, Exposure]:
    rows = zip(cameras, exposures.log_gain.tolist(), exposures.power.tolist(), strict=True)
    return {camera.name: Exposure(tuple(gain), tuple(power)) for camera, gain, power in rows}


def _beside(points: SparsePoints, views: int) -> Int[np.ndarray, "views neighbors"]:
    """Returns for each view the others that share the most points with it."""
    rows = []
    for k in range(views):
        seen = np.zeros(len(points.xyz_world), bool)
        seen[points.observed_point[points.observed_image == k]] = True
        shared = np.bincount(points.observed_image[seen[points.observed_point]], minlength=views)
        shared[k] = -1
        rows.append(np.argsort(-shared, kind="stable")[: min(_NEIGHBORS, views - 1)])
    return np.stack(rows)


def _halves(points: SparsePoints) -> Iterator[Bool[np.ndarray, " points"]]:
    """Yields which points are in the first half: of blocks by rank, then along principal axes."""
    xyz = points.xyz_world
    rank = xyz.argsort(axis=0).argsort(axis=0)
    block = rank * _BLOCKS // max(len(rank), 1)
    yield np.asarray(block.sum(axis=1) % 2 == 0)
    from_middle = xyz - np.median(xyz, axis=0)
    distance = np.linalg.norm(from_middle, axis=1)
    near = from_middle[distance <= _NEAR * np.median(distance)]
    for axis in np.linalg.eigh(near.T @ near)[1].T:
        along = from_middle @ axis
        yield np.asarray(along < np.median(along))
