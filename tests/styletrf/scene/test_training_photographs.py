"""A photograph held out has no part in the scene model, nor in what a field is fitted to."""

import shutil
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from captures import orbit_cameras, points_of, seen
from expected_errors import rejects

from styletrf.capture.views import load_views
from styletrf.field.training.observed_depths import observed_depths
from styletrf.field.training.view_exposures import view_exposures
from styletrf.files.images import write_rgb
from styletrf.files.tables import read_summary, write_summary
from styletrf.geometry.camera_table import read_cameras, write_cameras
from styletrf.geometry.point_table import read_points, write_points
from styletrf.scene.free_space import free_space
from styletrf.scene.scene_model import SceneModelConfig, write_scene_model
from styletrf.scene.training_photographs import model_of_photographs, read_training_photographs

CONFIG = SceneModelConfig(space="unbounded", exposure="each", image_long_side=60)
HELD_OUT, FITTED = "8", "3"


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What CameraPoses leaves of twelve photographs around a block, two of them held out."""
    rng, folder = np.random.default_rng(0), tmp_path_factory.mktemp("original") / "poses"
    (folder / "images").mkdir(parents=True)
    (folder / "masks").mkdir()
    cameras = orbit_cameras()
    for camera in cameras:
        image = rng.uniform(0.2, 0.8, (4, 6, 3)).repeat(10, axis=0).repeat(10, axis=1)
        write_rgb(folder / "images" / f"{camera.name}.png", image.astype(np.float32))
        write_rgb(folder / "masks" / f"{camera.name}.png", np.ones((40, 60, 3), np.float32))
    write_cameras(folder / "cameras.parquet", cameras, held_out={"0", HELD_OUT})
    write_points(folder / "points.parquet", seen(cameras, points_of("block")))
    sizes = {camera.name: (60, 40) for camera in cameras}
    write_summary(folder / "poses.json", {"photograph_sizes": sizes})
    return folder


@pytest.fixture
def poses(original: Path, tmp_path: Path) -> Path:
    """A copy to change."""
    return shutil.copytree(original, tmp_path / "poses")


@pytest.fixture(scope="module")
def before(original: Path) -> list[np.ndarray]:
    return list(fitted_to(original))


def other_pixels(poses: Path, name: str) -> None:
    dark = np.zeros((40, 60, 3), np.float32)
    write_rgb(poses / "images" / f"{name}.png", dark)


def other_mask(poses: Path, name: str) -> None:
    half = np.zeros((40, 60, 3), np.float32)
    half[:, :30] = 1
    write_rgb(poses / "masks" / f"{name}.png", half)


def other_camera(poses: Path, name: str) -> None:
    """The photograph was taken from far away, with a longer lens."""
    table = poses / "cameras.parquet"
    cameras = [
        replace(c, fx=2 * c.fx, fy=2 * c.fy, world_from_camera=c.world_from_camera * [1, 1, 1, 5])
        if c.name == name
        else c
        for c in read_cameras(table)
    ]
    write_cameras(table, cameras, held_out={"0", HELD_OUT})


def other_tracks(poses: Path, name: str) -> None:
    """The photograph observes none of the points."""
    points, row = read_points(poses / "points.parquet"), int(name)
    images = np.arange(len(read_cameras(poses / "cameras.parquet")))
    kept = np.isin(points.observed_image, images[images != row])
    write_points(
        poses / "points.parquet",
        replace(
            points,
            observed_point=points.observed_point[kept],
            observed_image=points.observed_image[kept],
            observed_pixel=points.observed_pixel[kept],
        ),
    )


def other_size(poses: Path, name: str) -> None:
    """Of the photograph as it came: that of its undistorted image is as before."""
    report = read_summary(poses / "poses.json")
    report["photograph_sizes"][name] = [6000, 4000]
    write_summary(poses / "poses.json", report)


CHANGES = [other_pixels, other_mask, other_camera, other_tracks, other_size]


def fitted_to(poses: Path) -> Iterator[np.ndarray]:
    """All that a field is trained on, and the bytes of the scene model; the quickest first."""
    photographs = read_training_photographs(poses)
    model = model_of_photographs(photographs, CONFIG)
    cameras = model.normalized(photographs.cameras)
    yield from (camera.world_from_camera for camera in cameras)
    yield from (view.numpy() for view in load_views(photographs.folder, cameras))
    write_scene_model(poses / "scene.json", model)
    yield np.frombuffer((poses / "scene.json").read_bytes(), np.uint8)
    exposures = view_exposures(photographs.cameras, model.exposures, torch.device("cpu"))
    assert exposures is not None
    yield from (part.numpy() for part in (exposures.log_gain, exposures.power))
    depths = observed_depths(
        model, photographs.cameras, photographs.points, photographs.images(), photographs.masks()
    )
    yield from (part.numpy() for part in (depths.view, depths.pixel, depths.depth))
    yield free_space(model, photographs.cameras, photographs.points)


def is_equal(some: Iterable[np.ndarray], others: Iterable[np.ndarray]) -> bool:
    """Whether all are equal; after the first that differ none is computed."""
    return all(np.array_equal(*pair) for pair in zip(some, others, strict=True))


def test_what_is_fitted_does_not_depend_on_a_photograph_held_out(before, poses):
    """Not on its pixels, its mask, its camera, its tracks or its size, which are all others."""
    for change in CHANGES:
        change(poses, HELD_OUT)
    assert is_equal(before, fitted_to(poses))


@pytest.mark.parametrize("change", CHANGES)
def test_what_is_fitted_depends_on_the_other_photographs(before, poses, change):
    change(poses, FITTED)
    assert not is_equal(before, fitted_to(poses))


def test_a_scene_whose_photographs_are_all_held_out_is_refused(poses):
    table = poses / "cameras.parquet"
    cameras = read_cameras(table)
    write_cameras(table, cameras, held_out={camera.name for camera in cameras})
    with rejects(f"{len(cameras)} photographs"):
        read_training_photographs(poses)
