"""Cameras for other programs: read by this project's own readers, and by Blender's conventions."""

import ast
import json
import runpy
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from styletrf.capture.poses.colmap_model import colmap_views
from styletrf.capture.poses.transforms_json import transforms_cameras
from styletrf.exports.blender_bundle import BLENDER_FROM_GLTF, write_blender_bundle
from styletrf.exports.camera_files import write_colmap_model, write_transforms
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
