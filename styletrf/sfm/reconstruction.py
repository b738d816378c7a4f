"""COLMAP's reconstruction in this project's own structs: pinhole cameras and sparse points."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from styletrf.colmap import pycolmap
from styletrf.geometry.cameras import Camera
from styletrf.geometry.point_table import SparsePoints
from styletrf.geometry.undistortion import pinhole_for, undistorted_pixels


@dataclass(frozen=True, slots=True)
class PlacedPhotograph:
    """A registered photograph: its file, its lens, and the pinhole camera to replace it by."""

    file: str
    image: pycolmap.Image
    lens: pycolmap.Camera
    camera: Camera


def placed_photographs(
    model: pycolmap.Reconstruction, names: Mapping[str, str]
) -> list[PlacedPhotograph]:
    """Returns the registered photographs of a model, in the order of `names`.

    Args:
        model: The reconstruction.
        names: For each of COLMAP's image files, the photograph's name.
    """
    images = {
        model.image(image_id).name: model.image(image_id) for image_id in model.reg_image_ids()
    }
    placed = []
    for file, name in names.items():
        if file in images:
            image = images[file]
            lens = model.camera(image.camera_id)
            world_from_camera = image.cam_from_world().inverse().matrix()
            camera = pinhole_for(lens, name, world_from_camera)
            placed.append(PlacedPhotograph(file, image, lens, camera))
    return placed


def sparse_points(
    model: pycolmap.Reconstruction, placed: Sequence[PlacedPhotograph]
) -> SparsePoints:
    """Returns the model's points; images are numbered as in `placed`, pixels are undistorted."""
    ids = sorted(model.points3D)
    points = [model.point3D(point_id) for point_id in ids]
    observed = [_observations(index, photograph) for index, photograph in enumerate(placed)]
    point_ids, image_rows, pixels = (np.concatenate(part) for part in zip(*observed, strict=True))
    order = np.argsort(point_ids, kind="stable")
    return SparsePoints(
        xyz_world=np.array([point.xyz for point in points]),
        rgb=np.array([point.color for point in points], dtype=np.uint8),
        error_px=np.array([point.error for point in points]),
        observed_point=np.searchsorted(ids, point_ids[order]),
        observed_image=image_rows[order],
        observed_pixel=pixels[order],
    )


def _observations(
    index: int, photograph: PlacedPhotograph
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns ids of points, the image's index for each, and pixels, of one photograph.

    Pixels for which the lens model has no direction, beyond its fold, are left out.
    """
    seen = photograph.image.get_observation_points2D()
    point_ids = np.array([point.point3D_id for point in seen], dtype=np.int64)
    distorted = np.array([point.xy for point in seen], dtype=np.float64).reshape(-1, 2)
    pixels = undistorted_pixels(distorted, photograph.lens, photograph.camera)
    shown = np.isfinite(pixels).all(axis=1)
    return point_ids[shown], np.full(shown.sum(), index), pixels[shown]
