"""Cameras as other programs read them: `transforms.json` and a model of COLMAP."""

import json
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from styletrf.colmap import pycolmap
from styletrf.geometry.cameras import Camera
from styletrf.geometry.point_table import SparsePoints

_OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])


def write_transforms(path: Path, cameras: Sequence[Camera], folder: str, suffix: str) -> None:
    """Writes the file of instant-ngp and nerfstudio: a lens and a pose for each frame.

    Args:
        path: The file to write.
        cameras: The cameras, in the world.
        folder: The folder of the images, seen from the file.
        suffix: Of the images' names.
    """
    frames = [
        {"file_path": f"{folder}/{camera.name}{suffix}", **_lens(camera), **_pose(camera)}
        for camera in cameras
    ]
    text = json.dumps({"camera_model": "PINHOLE", "frames": frames}, indent=1)
    path.write_text(text + "\n")


def write_colmap_model(
    folder: Path, cameras: Sequence[Camera], suffix: str, points: SparsePoints | None = None
) -> None:
    """Writes a model as binary files, and as text if it can hold the names.

    Readers of text end a name at its first space, and some prefer text to binary files.

    Args:
        folder: The folder to fill.
        cameras: The cameras, in the world; each gets a lens of its own.
        suffix: Of the images' names.
        points: The points that the cameras see; their tracks name cameras by place.
    """
    model = pycolmap.Reconstruction()
    for number, camera in enumerate(cameras, start=1):
        lens = [camera.fx, camera.fy, camera.cx, camera.cy]
        model.add_camera_with_trivial_rig(
            pycolmap.Camera(
                model="PINHOLE", width=camera.width, height=camera.height, params=lens,
                camera_id=number,
            )
        )  # fmt: skip
        rotation = pycolmap.Rotation3d(camera.world_from_camera[:, :3])
        world_from_camera = pycolmap.Rigid3d(rotation, camera.center_world)
        image = pycolmap.Image(name=f"{camera.name}{suffix}", camera_id=number, image_id=number)
        model.add_image_with_trivial_frame(image, world_from_camera.inverse())
    if points is not None:
        _add_points(model, points)
    model.write_binary(folder)
    if not any(map(str.isspace, "".join(camera.name for camera in cameras))):
        model.write_text(folder)


def _add_points(model: pycolmap.Reconstruction, points: SparsePoints) -> None:
    """Adds points with colors, errors and tracks to a model of images numbered from 1."""
    place_in_image = np.zeros(len(points.observed_image), np.int64)
    for row in np.unique(points.observed_image):
        seen = np.flatnonzero(points.observed_image == row)
        place_in_image[seen] = np.arange(len(seen))
        pixels = [pycolmap.Point2D(pixel) for pixel in points.observed_pixel[seen]]
        model.image(int(row) + 1).points2D = pycolmap.Point2DList(pixels)
    elements = [
        pycolmap.TrackElement(int(row) + 1, int(place))
        for row, place in zip(points.observed_image, place_in_image, strict=True)
    ]
    tracks = pairwise([0, *np.cumsum(points.track_length)])
    values = zip(points.xyz_world, points.rgb, points.error_px, tracks, strict=True)
    for xyz, rgb, error, (start, end) in values:
        number = model.add_point3D(xyz, pycolmap.Track(elements[start:end]), rgb)
        model.point3D(number).error = error


def _lens(camera: Camera) -> dict[str, Any]:
    lens = {"fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx, "cy": camera.cy}
    return {**lens, "w": camera.width, "h": camera.height}


def _pose(camera: Camera) -> dict[str, Any]:
    """Returns world from camera, with x right, y up, z back in the camera."""
    pose = np.vstack([camera.world_from_camera, [0.0, 0.0, 0.0, 1.0]]) @ _OPENGL_FROM_OPENCV
    return {"transform_matrix": pose.tolist()}
