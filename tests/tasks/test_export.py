"""`Export` on the mini scene: what is linked is there, and what cannot be exported is refused."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from luigi.parameter import ParameterException

import tasks
from styletrf.capture.poses.transforms_json import transforms_cameras
from styletrf.errors import InputError
from styletrf.geometry.camera_table import read_cameras
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
