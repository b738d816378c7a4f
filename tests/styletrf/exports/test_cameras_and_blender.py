"""Cameras for other programs: read by this project's own readers, and by Blender's conventions."""

import ast
import json
import runpy
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from styletrf.capture.poses.colmap_model import colmap_views
from styletrf.capture.poses.transforms_json import transforms_cameras
from styletrf.colmap import pycolmap
from styletrf.exports.blender_bundle import BLENDER_FROM_GLTF, write_blender_bundle
from styletrf.exports.camera_files import write_colmap_model, write_transforms
from styletrf.exports.splat_files import UP_FROM_DOWN
from styletrf.geometry.cameras import Camera, project
from styletrf.geometry.point_table import SparsePoints
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


@pytest.mark.parametrize("prefix", ["", "IMG ", "a\tb c "])
@pytest.mark.parametrize("preferred", [".bin", ".txt"])
def test_a_colmap_model_is_read_back_as_it_was_by_readers_of_either_preference(
    tmp_path: Path, prefix: str, preferred: str
):
    """Names ended at their first space."""
    given = [replace(camera, name=f"{prefix}{camera.name}") for camera in cameras()]
    write_colmap_model(tmp_path, given, ".png")
    others = [file for file in tmp_path.iterdir() if file.suffix != preferred]
    if list(tmp_path.glob(f"*{preferred}")):
        for file in others:
            file.unlink()
    for camera, view in zip(given, colmap_views(tmp_path, tmp_path), strict=True):
        assert view.file.name == f"{camera.name}.png"
        assert np.allclose(view.world_from_camera, camera.world_from_camera)
        assert np.allclose(view.lens.params, (camera.fx, camera.fy, camera.cx, camera.cy))


def test_a_colmap_model_is_in_text_as_well_unless_text_loses_a_name(tmp_path: Path):
    suffixes = {}
    for name in ("plain", "with a space"):
        (tmp_path / name).mkdir()
        write_colmap_model(tmp_path / name, [replace(cameras()[0], name=name)], ".png")
        suffixes[name] = {file.suffix for file in (tmp_path / name).iterdir()}
    assert suffixes == {"plain": {".bin", ".txt"}, "with a space": {".bin"}}


def test_a_colmap_model_is_read_with_colors_and_tracks_at_the_points_and_pixels(tmp_path: Path):
    """It had no points, with which 3D Gaussian Splatting begins."""
    seen, rng = cameras(), np.random.default_rng(0)
    xyz, rgb = rng.normal(size=(5, 3)), rng.integers(0, 256, (5, 3)).astype(np.uint8)
    observed = np.array([[0, 3], [0, 1], [1, 3], [1, 0], [3, 3], [4, 1]])  # point 2 in none
    pixels = rng.uniform(1, 40, (len(observed), 2))
    points = SparsePoints(xyz, rgb, rng.uniform(size=5), *observed.T, pixels)
    write_colmap_model(tmp_path, seen, ".png", points)
    for reader in ("read_binary", "read_text"):
        model = pycolmap.Reconstruction()
        getattr(model, reader)(tmp_path)
        found = [model.point3D(number) for number in sorted(model.points3D)]
        assert np.allclose([point.xyz for point in found], xyz)
        assert np.array_equal([point.color for point in found], rgb)
        assert np.allclose([point.error for point in found], points.error_px)
        tracks = []
        for k, point in enumerate(found):
            for element in point.track.elements:
                image = model.image(element.image_id)
                tracks.append([k, image.name, *image.points2D[element.point2D_idx].xy])
        expected = [
            [point, f"{seen[image].name}.png", *pixel]
            for (point, image), pixel in zip(observed, pixels, strict=True)
        ]
        assert [row[:2] for row in tracks] == [row[:2] for row in expected]
        assert np.allclose([row[2:] for row in tracks], pixels)


def in_blender(
    found: dict[str, Any], x: np.ndarray, y: np.ndarray, z: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Returns columns and rows as BKE_camera_params_compute_viewplane of Blender has them."""
    width, height = found["width"], found["height"]
    aspect_x, aspect_y = found["pixel_aspect_x"], found["pixel_aspect_y"]
    assert min(aspect_x, aspect_y) >= 1  # Blender's least
    y_correction = aspect_y / aspect_x
    is_horizontal = aspect_x * width >= aspect_y * height  # sensor fit AUTO
    view_factor = width if is_horizontal else y_correction * height
    pixel_size = found["sensor_mm"] / found["lens_mm"] / view_factor  # at a distance of 1
    left = -0.5 * width + found["shift_x"] * view_factor
    top = 0.5 * y_correction * height + found["shift_y"] * view_factor
    return x / -z / pixel_size - left, (top - y / -z / pixel_size) / y_correction


@pytest.mark.parametrize("stretch", [0.4, 1.0, 2.5])
def test_blender_sees_each_point_where_the_camera_saw_it(tmp_path: Path, stretch: float):
    """Cameras whose focal lengths differ were drawn stretched or shifted."""
    given = [replace(camera, fx=stretch * camera.fx) for camera in cameras()]
    write_blender_bundle(tmp_path, given, cameras(2), 24.0)
    values = json.loads((tmp_path / "cameras.json").read_text())
    blender_from_world = (BLENDER_FROM_GLTF @ UP_FROM_DOWN)[:3, :3]
    for camera, found in zip(given, values["photographs"], strict=True):
        ahead = camera.center_world + 3 * camera.forward_world
        points = ahead + np.random.default_rng(1).normal(size=(20, 3)) * 0.3
        inverse = np.linalg.inv(np.array(found["matrix_world"]))
        x, y, z = (points @ blender_from_world.T @ inverse[:3, :3].T + inverse[:3, 3]).T
        pixels, depth = project(camera, points)
        assert np.allclose(-z, depth)
        assert np.allclose(np.column_stack(in_blender(found, x, y, z)), pixels)


def test_the_bundle_has_a_script_that_python_parses_and_that_reads_what_lies_beside(tmp_path: Path):
    write_blender_bundle(tmp_path, cameras(), cameras(2), 24.0)
    tree = ast.parse((tmp_path / "import_scene.py").read_text())
    used = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    values = json.loads((tmp_path / "cameras.json").read_text())
    assert {*values, *values["path"][0]} <= used


class Animated(SimpleNamespace):
    """An object of Blender that keeps the values of its keyframes, by name and frame."""

    def __init__(self, name: str, data: "Animated | None" = None) -> None:
        super().__init__(name=name, data=data, keys={})

    def keyframe_insert(self, value: str, frame: int) -> None:
        self.keys[value, frame] = getattr(self, "matrix_world", None) or getattr(self, value)


def test_each_frame_of_the_fly_through_in_blender_has_its_own_pose_and_lens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """All frames had the lens of the first."""
    write_blender_bundle(tmp_path, [], cameras(), 24.0)
    placed: list[Animated] = []
    scene = SimpleNamespace(render=SimpleNamespace())
    objects = SimpleNamespace(link=placed.append)
    context = SimpleNamespace(scene=scene, collection=SimpleNamespace(objects=objects))
    data = SimpleNamespace(
        cameras=SimpleNamespace(new=Animated), objects=SimpleNamespace(new=Animated)
    )
    monkeypatch.setitem(sys.modules, "bpy", SimpleNamespace(context=context, data=data))
    monkeypatch.setitem(sys.modules, "mathutils", SimpleNamespace(Matrix=list))
    runpy.run_path(str(tmp_path / "import_scene.py"))
    (camera,) = placed
    assert scene.camera is camera
    for number, frame in enumerate(json.loads((tmp_path / "cameras.json").read_text())["path"], 1):
        assert camera.keys["location", number] == frame["matrix_world"]
        assert camera.keys["rotation_quaternion", number] == frame["matrix_world"]
        keyed = [camera.data.keys[name, number] for name in ("lens", "shift_x", "shift_y")]
        assert keyed == [frame[name] for name in ("lens_mm", "shift_x", "shift_y")]
