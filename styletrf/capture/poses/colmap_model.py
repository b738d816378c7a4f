"""Poses as COLMAP keeps them: `sparse/0` with cameras, images and points, binary or text.

Of several models, `sparse/0`, `sparse/1` and so on, the readable one with the most photographs that
are there is read.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from styletrf.capture.photographs import folder_of_pictures, natural_order
from styletrf.capture.poses.colmap_folders import colmap_folders
from styletrf.capture.poses.given_poses import (
    GivenPoses,
    GivenView,
    Lens,
    given_poses,
    is_there,
    require_inside,
)
from styletrf.capture.poses.upright_views import upright_views
from styletrf.colmap import pycolmap
from styletrf.errors import InputError


def read_colmap_model(folder: Path) -> GivenPoses | None:
    """Returns the registered photographs of a model below the folder; None where there is none.

    Photographs lie in `images`, or in the folder itself where that holds none, under the names that
    the model has for them.

    Raises:
        InputError: The model cannot be read, names a photograph elsewhere, or hardly one is there.
    """
    sources = colmap_folders(folder)
    if not sources:
        return None
    photographs = folder_of_pictures(folder)
    source, views = _largest(sources, photographs)
    for view in views:
        require_inside(source, photographs, view.file.parent)
    return given_poses(source, upright_views(views, are_stored=True))


def _largest(sources: Sequence[Path], photographs: Path) -> tuple[Path, list[GivenView]]:
    """Returns the model of most photographs that are there, of those that can be read.

    Raises:
        InputError: None can be read; it is the error of the first.
    """
    views_of, errors = {}, []
    for source in sources:
        try:
            views_of[source] = colmap_views(source, photographs)
        except InputError as error:
            errors.append(error)
    if not views_of:
        raise errors[0]
    return max(views_of.items(), key=lambda found: sum(is_there(view.file) for view in found[1]))


def colmap_views(source: Path, photographs: Path) -> list[GivenView]:
    """Returns the views of a model, whether or not their photographs are there.

    They are in the natural order of their names, and those of the pictures that COLMAP had.

    Raises:
        InputError: The model cannot be read.
    """
    try:
        model = pycolmap.Reconstruction(source)
        images = [model.image(i) for i in model.reg_image_ids()]
        images.sort(key=lambda image: natural_order(image.name))
        return [_view(photographs, one, model.camera(one.camera_id)) for one in images]
    except (ValueError, RuntimeError, IndexError) as error:
        reason = str(error).strip().split("\n")[0]
        problem = f"cannot be read as a COLMAP model ({reason})"
        raise InputError(str(source), problem, "Export it again, or remove it") from error


def lens_of(camera: pycolmap.Camera) -> Lens:
    """Returns the lens of one of COLMAP's cameras."""
    params = tuple(float(value) for value in camera.params)
    return Lens(str(camera.model_name), params, int(camera.width), int(camera.height))


def _view(folder: Path, image: pycolmap.Image, camera: pycolmap.Camera) -> GivenView:
    pose = np.asarray(image.cam_from_world().inverse().matrix(), dtype=np.float64)
    return GivenView(folder / image.name, lens_of(camera), pose)
