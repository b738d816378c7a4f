"""Poses as LLFF keeps them: `poses_bounds.npy`, one row a photograph in the order of their names.

A row is the 3x5 matrix [rotation | center | height, width, focal] and the depths of the nearest and
the farthest points. The columns of the rotation are the camera's down, right and backwards axes in
the world; the optical axis goes through the middle of the image (Mildenhall et al. 2019).
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from styletrf.capture.photographs import folder_of_pictures, list_photographs
from styletrf.capture.poses.given_poses import (
    GivenPoses,
    GivenView,
    Lens,
    given_poses,
    rigid,
)
from styletrf.capture.poses.upright_views import upright_views
from styletrf.errors import InputError
from styletrf.geometry.cameras import Camera

_REMEDY = (
    "Write it again with the photographs that are there, or move it away: then poses are estimated"
)


def read_llff_poses(path: Path, names: Sequence[str]) -> list[Camera]:
    """Returns the cameras of photographs, each of the size that its row says.

    Args:
        path: The `poses_bounds.npy`.
        names: The names of the photographs, sorted as the rows are.

    Raises:
        InputError: The file is no such table, or not of so many photographs, or not finite, or a
            height, width or focal length is below a pixel.
    """
    try:
        rows = np.load(path, allow_pickle=False).astype(np.float64)
    except (OSError, ValueError) as error:
        raise InputError(str(path), "is no table of numbers", _REMEDY) from error
    if rows.shape != (len(names), 17) or not np.isfinite(rows).all():
        problem = f"is not 17 finite numbers for each of {len(names)} photographs"
        raise InputError(str(path), problem, _REMEDY)
    matrices = rows[:, :15].reshape(-1, 3, 5)
    if (matrices[:, :, 4] < 1).any():
        problem = "has a height, a width or a focal length below a pixel"
        raise InputError(str(path), problem, _REMEDY)
    return [_camera(name, matrix) for name, matrix in zip(names, matrices, strict=True)]


def read_llff_folder(folder: Path) -> GivenPoses | None:
    """Returns the views of `poses_bounds.npy` and the photographs in a folder; None without it.

    Photographs lie in `images`, or in the folder itself where that holds none.

    Raises:
        InputError: As `read_llff_poses`.
    """
    path = folder / "poses_bounds.npy"
    if not path.exists():
        return None
    files = sorted(list_photographs(folder_of_pictures(folder)))
    cameras = read_llff_poses(path, [file.stem for file in files])
    views = [
        GivenView(file, _lens(camera), rigid(file.name, path, camera.world_from_camera))
        for file, camera in zip(files, cameras, strict=True)
    ]
    return given_poses(path, upright_views(views, are_stored=True))  # LLFF has them from COLMAP


def _lens(camera: Camera) -> Lens:
    params = tuple(float(value) for value in (camera.fx, camera.fy, camera.cx, camera.cy))
    return Lens("PINHOLE", params, camera.width, camera.height)


def _camera(name: str, matrix: Float[np.ndarray, "3 5"]) -> Camera:
    down, right, backwards, center = matrix[:, :4].T
    height, width, focal = matrix[:, 4]
    pose = np.column_stack([right, down, -backwards, center])
    return Camera(name, round(width), round(height), focal, focal, width / 2, height / 2, pose)
