"""Surveys what photographs and their poses show of a scene before a field is fitted to it.

Blur is judged by the Laplacian, exposure by the brightness of points that several photographs see,
coverage by how many photographs see each part of the grid's box.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from styletrf.capture.clips.frame_motion import sharpness
from styletrf.geometry.cameras import Camera, in_view
from styletrf.geometry.point_table import SparsePoints
from styletrf.geometry.space import Space
from styletrf.scene.exposures import estimate_exposures

ENOUGH_VIEWS = 3  # that see a part of the box
LEAST_SHARPNESS = 0.4  # of the median, and 3 deviations below it
MOST_EXPOSURE_EV = 0.5  # from the median, and 3 deviations
_CELLS = 16  # of the box along an axis
_DEVIATIONS = 3.0
_GAMMA = 2.2  # encoded brightness to light, near enough to compare exposures


@dataclass(frozen=True, slots=True)
class ViewSurvey:
    """Measures of one photograph; the exposure is against that of the others."""

    name: str
    sharpness: float
    exposure_ev: float
    points: int
    blurred: bool
    off_exposure: bool


@dataclass(frozen=True, slots=True)
class Survey:
    """Measures of all photographs together.

    `seen_by` is how many views see each cell of the grid, x y z, -1 where there is no world;
    `has_points` where the scene is.
    """

    views: Sequence[ViewSurvey]
    seen_by: Int[np.ndarray, "x y z"]
    has_points: Bool[np.ndarray, "x y z"]

    @property
    def sparse_fraction(self) -> float:
        """The fraction of the cells with points that fewer than 3 views see; 0 without cells."""
        seen_by = self.seen_by[self.has_points]
        return float((seen_by < ENOUGH_VIEWS).mean()) if len(seen_by) else 0.0

    @property
    def blind_fraction(self) -> float:
        """The fraction of the grid that fewer than 3 views see."""
        return float((self.seen_by[self.seen_by >= 0] < ENOUGH_VIEWS).mean())


def survey_scene(
    images: Iterable[UInt8[np.ndarray, "height width 3"]],
    points: SparsePoints,
    points_grid: Float[np.ndarray, "points 3"],
    space: Space,
    normalized: Sequence[Camera],
) -> Survey:
    """Returns the measures of the photographs.

    Args:
        images: The registered photographs, in the order of the table, at the size of its cameras.
        points: The points with their tracks.
        points_grid: The points in grid coordinates.
        space: The space of the model.
        normalized: The photographs' cameras in the normalized world.
    """
    light = np.full(len(points.observed_point), np.nan)
    sharp = np.zeros(len(normalized))
    for k, image in enumerate(images):
        sharp[k] = sharpness(image)
        of_image = points.observed_image == k
        light[of_image] = _light_at(image, points.observed_pixel[of_image])
    found = estimate_exposures(points, light[:, None], len(normalized), powers=False)
    exposure_ev = _GAMMA / np.log(2) * found.log_gain[:, 0]
    seen = np.bincount(points.observed_image, minlength=len(normalized))
    blurred, off = _blurred(sharp), _off_exposure(exposure_ev)
    views = [
        ViewSurvey(
            camera.name, float(sharp[k]), float(exposure_ev[k]), int(seen[k]), bool(blurred[k]),
            bool(off[k]),
        )
        for k, camera in enumerate(normalized)
    ]  # fmt: skip
    return Survey(views, _seen_by(space, normalized), _cells_with(points_grid))


def _light_at(
    image: UInt8[np.ndarray, "height width 3"], pixels: Float[np.ndarray, "observations 2"]
) -> Float[np.ndarray, " observations"]:
    """Returns the log of the brightness at pixels; NaN where too dark or too bright to know."""
    height, width = image.shape[:2]
    column = np.clip(pixels[:, 0].astype(np.int64), 0, width - 1)
    row = np.clip(pixels[:, 1].astype(np.int64), 0, height - 1)
    encoded = image[row, column].astype(np.float64).mean(axis=1)
    usable = (encoded > 12) & (encoded < 243)
    return np.log(np.where(usable, encoded / 255, np.nan))


def _blurred(sharp: Float[np.ndarray, " views"]) -> Bool[np.ndarray, " views"]:
    logs = np.log(np.maximum(sharp, 1e-12))
    middle = np.median(logs)
    limit = min(-_DEVIATIONS * _deviation(logs), float(np.log(LEAST_SHARPNESS)))
    return np.asarray(logs - middle < limit)


def _off_exposure(exposure: Float[np.ndarray, " views"]) -> Bool[np.ndarray, " views"]:
    away = np.abs(exposure - np.median(exposure))
    return np.asarray(away > max(_DEVIATIONS * _deviation(exposure), MOST_EXPOSURE_EV))


def _deviation(values: Float[np.ndarray, " values"]) -> float:
    """Returns a standard deviation that outliers do not change (1.48 median deviations)."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def _seen_by(space: Space, cameras: Sequence[Camera]) -> Int[np.ndarray, "x y z"]:
    centers = space.cell_centers(_CELLS)
    count = np.zeros(len(centers), np.int64)
    for camera in cameras:
        _, depth, inside = in_view(camera, centers)
        count += inside & (depth > space.depth_min)
    count[np.isnan(centers[:, 0])] = -1
    return count.reshape(_CELLS, _CELLS, _CELLS)


def _cells_with(points_grid: Float[np.ndarray, "points 3"]) -> Bool[np.ndarray, "x y z"]:
    inside = (np.abs(points_grid) <= 1).all(axis=1)
    cell = np.minimum(((points_grid[inside] + 1) * (_CELLS / 2)).astype(np.int64), _CELLS - 1)
    result = np.zeros((_CELLS, _CELLS, _CELLS), bool)
    result[tuple(cell.T)] = True
    return result
