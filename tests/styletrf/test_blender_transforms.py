"""The synthetic scenes' transforms: their axes, their field of view, their alpha."""

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from styletrf.blender_transforms import on_white, read_blender_cameras, read_rgba
from styletrf.cameras import project
from styletrf.errors import InputError


def written(tmp_path: Path, frames) -> Path:
    path = tmp_path / "transforms_train.json"
    path.write_text(json.dumps({"camera_angle_x": math.pi / 2, "frames": frames}))
    return path


def test_opengl_looks_along_minus_z_with_y_up(tmp_path):
    pose = np.eye(4)
    pose[:3, 3] = [1, 2, 3]
    path = written(tmp_path, [{"file_path": "./train/r_0", "transform_matrix": pose.tolist()}])
    (camera,) = read_blender_cameras(path, 40, 20)
    assert camera.name == "train/r_0"
    pixels, depth = project(camera, np.array([[1.0, 2, -7], [6, 2, -7], [1, 4, -7]]))
    np.testing.assert_allclose(depth, 10)
    np.testing.assert_allclose(pixels, [[20, 10], [30, 10], [20, 6]])


@pytest.mark.parametrize("pose", [np.eye(3), np.full((4, 4), np.inf)])
def test_poses_that_are_none_are_told(tmp_path, pose):
    path = written(tmp_path, [{"file_path": "a", "transform_matrix": pose.tolist()}])
    with pytest.raises(InputError, match="has a pose that is not 4x4 finite numbers"):
        read_blender_cameras(path, 40, 20)


def test_a_file_of_another_kind_is_told(tmp_path):
    path = tmp_path / "transforms_train.json"
    path.write_text("{}")
    with pytest.raises(InputError, match="is no transforms file"):
        read_blender_cameras(path, 40, 20)


def test_what_is_transparent_is_white(tmp_path):
    bgra = np.zeros((2, 2, 4), np.uint8)
    bgra[0, 0] = [0, 0, 255, 255]
    cv2.imwrite(str(tmp_path / "a.png"), bgra)
    white = on_white(read_rgba(tmp_path / "a.png"))
    np.testing.assert_array_equal(white[0, 0], [1, 0, 0])
    np.testing.assert_array_equal(white[1, 1], [1, 1, 1])


def test_an_image_without_alpha_is_told(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((2, 2, 3), np.uint8))
    with pytest.raises(InputError, match="with alpha"):
        read_rgba(tmp_path / "a.png")
