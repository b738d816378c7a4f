"""Photographs without a camera, as the lens of the scene shows them, and what is written."""

import json
from dataclasses import asdict

import numpy as np
import pytest
from message_words import mentions
from mini_scene import painted_plane

from styletrf.capture.poses.given_poses import Lens
from styletrf.capture.scene_capture import capture_photographs
from styletrf.content.procedural_images import procedural_image
from styletrf.evaluation.alignment.photograph_placement import (
    PhotographPlacement,
    place_unregistered,
    unplaced_photographs,
    write_placements,
)
from styletrf.files.images import write_png
from styletrf.files.tables import read_summary, write_summary
from styletrf.geometry.camera_table import write_cameras
from styletrf.geometry.cameras import Camera
from styletrf.sfm.poses_report import FoundLens

LENS = {"camera_model": "SIMPLE_RADIAL", "camera_params": [70.0, 32.0, 24.0, 0.0]}


def view(name: str) -> Camera:
    return Camera(name, 64, 48, 70.0, 70.0, 32.0, 24.0, np.eye(3, 4))


@pytest.fixture
def scene(tmp_path):
    """A capture of five photographs, two of them upright, and poses of the first three."""
    photographs, capture, poses = (tmp_path / name for name in ("scene", "capture", "poses"))
    rng = np.random.default_rng(0)
    sizes = {"a": (96, 128), "b": (96, 128), "c": (128, 96), "lost": (96, 128), "tall": (128, 96)}
    for folder in (photographs, capture, poses):
        folder.mkdir()
    for name, size in sizes.items():
        write_png(photographs / f"{name}.png", procedural_image(rng, *size), compression=1)
    capture_photographs(photographs, capture)
    write_cameras(poses / "cameras.parquet", [view(n) for n in "abc"], ["lost", "tall"])
    write_summary(poses / "poses.json", LENS | {"width": 64, "height": 48})
    return capture, poses


def test_photographs_of_another_size_are_looked_for_with_their_own_lens(scene):
    """Only those of the first photograph's shape were looked for, and nothing said so."""
    _, poses = scene
    lying = Lens("SIMPLE_RADIAL", (70.0, 32.0, 24.0, 0.0), 64, 48)
    upright = Lens("SIMPLE_RADIAL", (75.0, 24.0, 32.0, 0.0), 48, 64)
    lenses = [asdict(FoundLens(lens, photographs=1)) for lens in (lying, upright)]
    write_summary(poses / "poses.json", {"lenses": lenses})
    found = {camera.name: camera for camera, _ in unplaced_photographs(*scene)}
    assert {name: (c.width, c.height, round(c.fx)) for name, c in found.items()} == {
        "lost": (64, 48, 70),
        "tall": (48, 64, 75),
    }


def test_a_photograph_held_upright_is_looked_for_with_the_turned_lens(scene):
    cameras = {camera.name: camera for camera, _ in unplaced_photographs(*scene)}
    tall = cameras["tall"]
    assert (tall.width, tall.height) == (48, 64)
    assert (tall.fx, tall.cx, tall.cy) == pytest.approx((70.0, 24.0, 32.0))


def test_photographs_of_a_shape_that_no_lens_has_are_named(scene, caplog):
    _, poses = scene
    square = LENS | {"camera_params": [70.0, 32.0, 32.0, 0.0], "width": 64, "height": 64}
    write_summary(poses / "poses.json", square)
    assert list(unplaced_photographs(*scene)) == []
    assert mentions(caplog.text, "lost", "tall")


def test_photographs_are_looked_for_at_the_size_of_the_lens(scene):
    camera, image = next(unplaced_photographs(*scene))
    assert camera.name == "lost"
    assert image.shape == (48, 64, 3)
    assert (camera.width, camera.height) == (64, 48)
    assert camera.fx == pytest.approx(70.0)
    assert 0 <= image.min() < image.max() <= 1


def test_large_photographs_are_held_at_the_size_at_which_they_are_compared(scene):
    """All of them were held at the size of the lens: 4.6 GB of a hundred."""
    _, poses = scene
    large = {"camera_params": [700.0, 320.0, 240.0, 0.0], "width": 640, "height": 480}
    write_summary(poses / "poses.json", LENS | large)
    camera, image = next(unplaced_photographs(*scene))
    assert image.shape == (camera.height, camera.width, 3) == (144, 192, 3)
    assert camera.fx == pytest.approx(700 * 192 / 640)
    assert 0 <= image.min() < image.max() <= 1


def without_cameras(folder, shapes):
    """Writes a capture of photographs by name and shape, none of which has a camera."""
    photographs, capture, poses = (folder / name for name in ("scene", "capture", "poses"))
    for each in (photographs, capture, poses):
        each.mkdir()
    for k, (name, shape) in enumerate(shapes.items()):
        write_png(photographs / f"{name}.png", np.full((*shape, 3), k, np.uint8), compression=1)
    capture_photographs(photographs, capture)
    write_cameras(poses / "cameras.parquet", [], list(shapes))
    write_summary(poses / "poses.json", LENS | {"width": 64, "height": 48})
    return capture, poses


def test_of_many_photographs_without_a_camera_some_are_tried_and_a_warning_says_so(
    tmp_path, caplog
):
    names = [f"{k:02d}" for k in range(30)]
    scene = without_cameras(tmp_path, dict.fromkeys(names, (24, 32)))
    tried = [camera.name for camera, _ in unplaced_photographs(*scene)]
    assert len(set(tried)) == 20
    assert {"00", "29"} <= set(tried) <= set(names)
    assert mentions(caplog.text, 30, 20)


def test_photographs_that_no_lens_can_show_do_not_count_among_the_twenty_tried(tmp_path):
    """Of 20 chosen by name, those of other shapes were dropped: few of many were tried."""
    shapes = {f"{k:02d}": (32, 32) if k % 2 else (24, 32) for k in range(44)}
    tried = [camera.name for camera, _ in unplaced_photographs(*without_cameras(tmp_path, shapes))]
    usable = [name for name, shape in shapes.items() if shape == (24, 32)]
    assert len(set(tried)) == 20
    assert {usable[0], usable[-1]} <= set(tried) <= set(usable)


def test_where_all_photographs_have_a_camera_nothing_is_rendered(scene, tmp_path):
    capture, poses = scene
    write_cameras(poses / "cameras.parquet", [view(n) for n in "abc"])
    model = painted_plane(3).model
    place_unregistered(tmp_path / "placed.json", capture, poses, model, pytest.fail)
    assert read_summary(tmp_path / "placed.json") == {}


def test_poses_are_written_in_the_world_of_the_poses_and_only_of_what_is_placed(tmp_path):
    normalized_from_world = np.diag([2.0, 2.0, 2.0, 1.0])
    moved = Camera("near", 64, 48, 70.0, 70.0, 32.0, 24.0, np.eye(3, 4, k=0))
    moved.world_from_camera[:, 3] = 4.0
    placements = [
        PhotographPlacement(moved, 0.9, 0.7),
        PhotographPlacement(view("foreign"), 0.1, 0.7),
    ]
    write_placements(tmp_path / "placed.json", placements, normalized_from_world)
    rows = read_summary(tmp_path / "placed.json")
    assert np.array(rows["near"]["world_from_camera"])[:, 3] == pytest.approx([2.0, 2.0, 2.0])
    assert "world_from_camera" not in rows["foreign"]
    assert json.dumps(rows["foreign"], sort_keys=True) == '{"detail": 0.1, "needed": 0.7}'
