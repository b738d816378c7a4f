"""Cameras for other programs: read by this project's own readers, and by Blender's conventions."""

import ast
import json
from pathlib import Path

import numpy as np

from styletrf.capture.poses.colmap_model import colmap_views
from styletrf.capture.poses.transforms_json import transforms_cameras
from styletrf.exports.blender_bundle import BLENDER_FROM_GLTF, write_blender_bundle
from styletrf.exports.camera_files import write_colmap_text, write_transforms
from styletrf.exports.splat_files import UP_FROM_DOWN
from styletrf.geometry.cameras import Camera, project
from styletrf.geometry.rotations import matrices_of


def cameras(count: int = 4) -> list[Camera]:
    rng = np.random.default_rng(0)
    rotations = matrices_of(rng.normal(size=(count, 4)))
    poses = np.concatenate([rotations, rng.normal(size=(count, 3, 1))], axis=2)
    return [
        Camera(f"{k}", 40 + 24 * k, 48, 50.0 + k, 52.0, 21.0, 23.0 + k, pose)
        for k, pose in enumerate(poses)
    ]


def test_transforms_are_read_back_as_they_were(tmp_path: Path):
    write_transforms(tmp_path / "transforms.json", cameras(), "images", ".png")
    for camera, view in zip(
        cameras(), transforms_cameras(tmp_path / "transforms.json"), strict=True
    ):
        assert str(view.file) == f"images/{camera.name}.png"
        assert np.allclose(view.world_from_camera, camera.world_from_camera)
        assert view.lens.params == (camera.fx, camera.fy, camera.cx, camera.cy)
        assert (view.lens.width, view.lens.height) == (camera.width, camera.height)


def test_a_colmap_model_is_read_back_as_it_was(tmp_path: Path):
    write_colmap_text(tmp_path, cameras(), ".png")
    assert {path.suffix for path in tmp_path.iterdir()} == {".txt"}
    for camera, view in zip(cameras(), colmap_views(tmp_path, tmp_path), strict=True):
        assert view.file.name == f"{camera.name}.png"
        assert np.allclose(view.world_from_camera, camera.world_from_camera)
        assert np.allclose(view.lens.params, (camera.fx, camera.fy, camera.cx, camera.cy))


def test_blender_sees_each_point_where_the_camera_saw_it(tmp_path: Path):
    write_blender_bundle(tmp_path, cameras(), cameras(2), 24.0)
    values = json.loads((tmp_path / "cameras.json").read_text())
    blender_from_world = (BLENDER_FROM_GLTF @ UP_FROM_DOWN)[:3, :3]
    for camera, found in zip(cameras(), values["photographs"], strict=True):
        ahead = camera.center_world + 3 * camera.forward_world
        points = ahead + np.random.default_rng(1).normal(size=(20, 3)) * 0.3
        inverse = np.linalg.inv(np.array(found["matrix_world"]))
        x, y, z = (points @ blender_from_world.T @ inverse[:3, :3].T + inverse[:3, 3]).T
        longer = max(found["width"], found["height"])
        focal = found["lens_mm"] / found["sensor_mm"] * longer
        column = found["width"] / 2 - focal * x / z - found["shift_x"] * longer
        row = found["height"] / 2 + (focal * y / z) / found["pixel_aspect_y"]
        row += found["shift_y"] * longer
        pixels, depth = project(camera, points)
        assert np.allclose(-z, depth)
        assert np.allclose(np.column_stack([column, row]), pixels)


def test_the_bundle_has_a_script_that_python_parses_and_that_reads_what_lies_beside(tmp_path: Path):
    write_blender_bundle(tmp_path, cameras(), cameras(2), 24.0)
    tree = ast.parse((tmp_path / "import_scene.py").read_text())
    used = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    values = json.loads((tmp_path / "cameras.json").read_text())
    assert {*values, *values["path"][0]} <= used
