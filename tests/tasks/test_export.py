"""`Export` on the mini scene: what is linked is there, and what cannot be exported is refused."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from luigi.parameter import ParameterException

import tasks
from styletrf.capture.poses.transforms_json import transforms_cameras
from styletrf.errors import InputError
from styletrf.exports.blender_bundle import BLENDER_FROM_GLTF
from styletrf.exports.splat_files import UP_FROM_DOWN
from styletrf.geometry.camera_table import read_cameras, write_cameras
from styletrf.geometry.cameras import moved
from styletrf.scene.scene_model import read_scene_model, write_scene_model
from tasks.machine import optional_dependencies

Mini = Callable[..., Path]
FORMATS = {
    "ply": "gsply",
    "spz": "gsply",
    "points": "trimesh",
    "mesh": "skimage",
    "blender": "skimage",
    "cameras": "json",
}


@pytest.mark.parametrize("file_format", list(FORMATS))
def test_every_linked_file_is_there(file_format: str, mini: Mini, out: Path):
    pytest.importorskip(FORMATS[file_format], reason="not installed (extra export)")
    styles = () if file_format == "cameras" else ("p",)
    made = mini("Export", format=file_format, styles=styles)
    task = tasks.Export(scene="mini", styles=styles, format=file_format)

    def place(stage: Any) -> Path:
        return made if stage.task_family == "Export" else mini(stage.task_family)

    assert task.folder == out / "mini" / "export" / file_format
    assert all(target.exists() for target in task.links(place).values())
    linked = {target for target in task.links(place).values() if target.parent == made}
    assert linked == set(made.iterdir())
    assert json.loads((made / "export.json").read_text())["format"] == file_format


def test_cameras_are_in_the_world_of_the_poses(mini: Mini):
    made, poses = mini("Export", format="cameras", styles=()), mini("CameraPoses")
    cameras = read_cameras(poses / "cameras.parquet")
    views = transforms_cameras(made / "transforms.json")
    for camera, view in zip(cameras, views, strict=True):
        assert view.world_from_camera == pytest.approx(camera.world_from_camera, abs=1e-9)
        assert (poses / view.file).is_file()


def test_in_blender_georeferenced_cameras_lie_about_the_mesh_as_others_do(
    stage_of: Callable[..., Any], build: Mini, tmp_path: Path
):
    """Single precision rounded both to half a meter."""
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed (extra export)")
    pytest.importorskip("skimage", reason="scikit-image is not installed (extra export)")
    stage, inputs = stage_of("Export", format="blender", styles=())
    away, moved_inputs = np.eye(4), {name: tmp_path / name for name in ("poses", "model")}
    away[:3, 3] = (452000.0, -5411000.0, 300.0)
    for folder in moved_inputs.values():
        folder.mkdir()
    cameras = read_cameras(inputs["poses"] / "cameras.parquet")
    moved_cameras = [moved(camera, away) for camera in cameras]
    write_cameras(moved_inputs["poses"] / "cameras.parquet", moved_cameras)
    model = read_scene_model(inputs["model"] / "scene.json")
    from_away = model.normalized_from_world @ np.linalg.inv(away)
    write_scene_model(
        moved_inputs["model"] / "scene.json", replace(model, normalized_from_world=from_away)
    )
    places = []
    for given in (inputs, inputs | moved_inputs):
        made = build(stage, **given)
        (mesh,) = trimesh.load(made / "photographs.glb", process=False).geometry.values()
        values = json.loads((made / "cameras.json").read_text())
        matrices = np.array([c["matrix_world"] for c in (*values["photographs"], *values["path"])])
        middle = mesh.vertices.mean(axis=0) @ BLENDER_FROM_GLTF[:3, :3].T
        offset = json.loads((made / "export.json").read_text())["offset_world"]
        places.append((offset, matrices[:, :3, 3], middle))
    (none, local, local_middle), (offset, georeferenced, middle) = places
    assert none == [0, 0, 0]
    shift = (BLENDER_FROM_GLTF @ UP_FROM_DOWN)[:3, :3] @ (away[:3, 3] - offset)
    assert np.abs(shift).max() < 1
    assert np.abs(georeferenced - local - shift).max() < 1e-6
    assert np.abs(middle - local_middle - shift).max() < 1e-2


def test_every_frame_of_the_path_has_its_image(mini: Mini):
    views = transforms_cameras(mini("Export", format="cameras", styles=()) / "transforms_path.json")
    assert len(views) == 7
    assert all((mini("TrajectoryFrames") / view.file).is_file() for view in views)


@pytest.mark.parametrize(
    "styles",
    [("p", "p"), ("photographs",), (3,), ("",)],
    ids=["twice", "reserved", "number", "empty"],
)
def test_styles_that_are_not_each_one_name_are_refused(styles: tuple[Any, ...]):
    with pytest.raises(InputError) as refused:
        tasks.Export(scene="s", styles=styles, format="points").validate()
    assert refused.value.remedy


def test_styles_are_refused_for_cameras_which_have_none():
    """They changed the key and nothing else."""
    tasks.Export(scene="s", format="cameras").validate()
    with pytest.raises(InputError) as refused:
        tasks.Export(scene="s", styles=("p",), format="cameras").validate()
    assert "cameras" in refused.value.problem
    assert refused.value.remedy


def test_an_unknown_format_is_refused():
    with pytest.raises((ParameterException, ValueError)):
        tasks.Export(scene="s", format="stl")


def test_an_export_as_glb_is_the_export_of_a_mesh():
    assert tasks.Export(scene="s", format="glb") == tasks.Export(scene="s", format="mesh")


def test_a_missing_package_is_refused_before_anything_runs(monkeypatch: pytest.MonkeyPatch):
    missing = {"spz": ("no-such-package",)}
    monkeypatch.setattr(optional_dependencies, "EXPORT_PACKAGES", missing)
    with pytest.raises(InputError) as refused:
        tasks.Export(scene="s", format="spz").validate()
    assert "no-such-package" in refused.value.problem
    assert refused.value.remedy


def test_an_export_of_cameras_needs_no_field():
    assert "field" not in tasks.Export(scene="s", format="cameras").requires()
    assert "stylized p" in tasks.Export(scene="s", styles=("p",), format="mesh").requires()
