"""Finds free space before the fit: between a camera and the nearest sparse points that it sees.

A photograph that shows points in a tile of its image sees through all that lies well before the
nearest of them, there and in the tiles around it. Space that two photographs see through is free.
The views of one panorama count as one photograph, because they see all from one place.
Tiles without points say nothing: a white wall has no points either.

This keeps fog from growing right before cameras that stand in the grid. In NDC no camera does, and
thin things with few points, such as railings, would be lost for nothing.
"""

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Bool, Float

from styletrf.capture.views import places_of
from styletrf.geometry.cameras import Camera, in_view
from styletrf.geometry.point_table import SparsePoints
from styletrf.scene.placement import transformed
from styletrf.scene.scene_model import SceneModel

CELLS = 64  # of the grid along an axis
CLEAR = 0.7  # of the depth of the nearest points
_WITNESSES = 2
_TILES = 12  # along an image's longer side


def free_space(
    model: SceneModel, cameras: Sequence[Camera], points: SparsePoints
) -> Bool[np.ndarray, "cells cells cells"]:
    """Returns the cells of the model's grid that are free; cameras and points are the world's."""
    if model.space.kind == "ndc":
        return np.zeros((CELLS, CELLS, CELLS), bool)
    centers = model.space.cell_centers(CELLS)
    normalized = transformed(model.normalized_from_world, points.xyz_world)
    witnesses = np.zeros(len(centers), np.int32)
    views, places = model.normalized(cameras), np.array(places_of(cameras))
    for place in np.unique(places):
        is_clear = np.zeros(len(centers), bool)
        for k in np.flatnonzero(places == place):
            seen = normalized[points.observed_point[points.observed_image == k]]
            is_clear |= _sees_through(views[k], centers, _clear_depths(views[k], seen))
        witnesses += is_clear
    return (witnesses >= _WITNESSES).reshape(CELLS, CELLS, CELLS)


def _tiles(camera: Camera) -> tuple[int, int, float]:
    """Returns rows and columns of the tiles, and their side in pixels."""
    side = max(camera.width, camera.height) / _TILES
    return int(np.ceil(camera.height / side)), int(np.ceil(camera.width / side)), side


def _clear_depths(
    camera: Camera, seen: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "rows columns"]:
    """Returns the depth up to which each tile is clear, 0 where it shows no points."""
    rows, columns, side = _tiles(camera)
    pixels, depth, inside = in_view(camera, seen)
    row, column = (pixels[inside, ::-1] // side).astype(np.int64).T
    nearest = np.full((rows, columns), np.inf)
    np.minimum.at(nearest, (row, column), depth[inside])
    about = cv2.erode(nearest, np.ones((3, 3)))
    clear: Float[np.ndarray, "rows columns"] = np.where(np.isfinite(nearest), CLEAR * about, 0.0)
    return clear


def _sees_through(
    camera: Camera,
    centers: Float[np.ndarray, "cells 3"],
    clear: Float[np.ndarray, "rows columns"],
) -> Bool[np.ndarray, " cells"]:
    pixels, depth, inside = in_view(camera, centers)
    side = _tiles(camera)[2]
    row, column = (pixels[inside, ::-1] // side).astype(np.int64).T
    result = np.zeros(len(centers), bool)
    result[inside] = depth[inside] < clear[row, column]
    return result
