"""Depths of the photographs' pixels, where several photographs agree on them.

Sparse points are the corners that COLMAP matched. Between them, few photographs can each be
explained by colors right before the camera. A plane sweep finds depths for most textured pixels, at
a size at which neighbors look alike. A depth is kept where its windows correlate and where the
depth map of another photograph has the same surface there (Merrell et al. 2007).
"""

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float, Float32

from styletrf.geometry.cameras import Camera, fitted_to, in_view, pixel_centers, points_at_depth
from styletrf.geometry.point_table import SparsePoints
from styletrf.scene.placement import transformed
from styletrf.scene.scene_model import SceneModel
from styletrf.scene.stereo.neighbors import neighbors
from styletrf.scene.stereo.plane_sweep import GrayView, SweptDepth, swept_depth

LONG_SIDE_PX = 256
LEAST_SCORE = 0.6
TOLERANCE = 0.02  # of a depth, between two depth maps
_FEWEST_POINTS = 5  # that give the range of depths
_BEYOND = 0.6, 1.4  # of the nearest and the farthest points' inverse depths

Image = Float[np.ndarray, "_ _ 3"]
Mask = Bool[np.ndarray, "_ _"]


@dataclass(frozen=True, slots=True)
class StereoDepth:
    """The depths of a photograph, at a small size.

    Attributes:
        camera: The camera at that size, in the normalized world.
        depth: The depth along the camera's axis; infinite where it is unknown.
    """

    camera: Camera
    depth: Float32[np.ndarray, "height width"]


def stereo_depths(
    model: SceneModel,
    cameras: Sequence[Camera],
    points: SparsePoints,
    images: Iterable[Image],
    masks: Iterable[Mask | None],
) -> list[StereoDepth]:
    """Returns the depths of all photographs, in the normalized world.

    Args:
        model: The model of the scene.
        cameras: The cameras in the world, in the order in which `points` counts images.
        points: The points with their tracks.
        images: The images of the cameras, RGB in [0, 1], at any size.
        masks: Which pixels count, at the images' size; None where all of an image do.
    """
    views = list(map(_small, model.normalized(cameras), images, masks))
    compared = neighbors(cameras, points)
    in_model = transformed(model.normalized_from_world, points.xyz_world)

    def swept(k: int) -> SweptDepth:
        observed = in_model[points.observed_point[points.observed_image == k]]
        return _swept(views[k], [views[j] for j in compared[k]], observed)

    with ThreadPoolExecutor(torch.get_num_threads()) as pool:
        maps = list(pool.map(swept, range(len(views))))
    cameras_small = [view.camera for view in views]
    return [
        StereoDepth(camera, _agreed(k, cameras_small, maps, compared[k]))
        for k, camera in enumerate(cameras_small)
    ]


def _small(camera: Camera, image: Image, mask: Mask | None) -> GrayView:
    camera = fitted_to(camera, LONG_SIDE_PX)
    size = (camera.width, camera.height)
    gray = cv2.cvtColor(image.astype(np.float32), cv2.COLOR_RGB2GRAY)
    gray = cv2.resize(gray, size, interpolation=cv2.INTER_AREA)
    if mask is None:
        return GrayView(camera, gray, np.ones(gray.shape, bool))
    counts = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0.99
    return GrayView(camera, gray, counts)


def _swept(
    view: GrayView, others: Sequence[GrayView], observed: Float[np.ndarray, "points 3"]
) -> SweptDepth:
    """Returns the sweep between the nearest and the farthest of the points that a view observes."""
    _, depth, inside = in_view(view.camera, observed)
    if inside.sum() < _FEWEST_POINTS or not others:
        return SweptDepth(np.ones_like(view.gray), np.full_like(view.gray, -1))
    nearest, farthest = np.quantile(depth[inside], [0.01, 0.99])
    swept = swept_depth(view, others, nearest / _BEYOND[1], farthest / _BEYOND[0])
    return SweptDepth(swept.depth, np.where(view.counts, swept.score, np.float32(-1)))


def _agreed(
    k: int, cameras: Sequence[Camera], maps: Sequence[SweptDepth], others: Sequence[int]
) -> Float32[np.ndarray, "height width"]:
    """Returns a view's depths, infinite where no map of another photograph has them, too."""
    camera, own = cameras[k], maps[k]
    pixels = pixel_centers(camera.width, camera.height)
    surface = points_at_depth(camera, pixels, own.depth.ravel().astype(np.float64))
    is_shared = np.zeros(len(pixels), bool)
    for j in others:
        at, depth, inside = in_view(cameras[j], surface)
        column, row = np.floor(np.where(inside[:, None], at, 0)).astype(int).T
        is_near = np.abs(maps[j].depth[row, column] - depth) < TOLERANCE * depth
        is_shared |= inside & is_near & (maps[j].score[row, column] > LEAST_SCORE)
    is_known = (own.score > LEAST_SCORE) & is_shared.reshape(own.score.shape)
    return np.where(is_known, own.depth, np.float32(np.inf))
