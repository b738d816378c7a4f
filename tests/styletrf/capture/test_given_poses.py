"""Scenes that already have poses, in every format, held to their photographs by reprojection."""

import re
from pathlib import Path

import numpy as np
import pytest
from expected_errors import rejects
from given_cameras import VIEWS, colmap
from made_photographs import room_poses
from message_words import mentions
from posed_scenes import (
    blender,
    colmap_text,
    instant_ngp,
    llff,
    nerfstudio_fisheye,
    third_coefficient,
)

from styletrf.capture.capture_file import read_capture
from styletrf.capture.poses.pose_formats import find_given_poses
from styletrf.capture.scene_capture import capture_photographs, given_views
from styletrf.geometry.camera_table import read_cameras, read_fitted_rows, read_split
from styletrf.geometry.cameras import project
from styletrf.geometry.point_table import read_points
from styletrf.sfm.camera_poses import CameraPosesConfig, solve_camera_poses


@pytest.fixture(
    scope="module",
    params=[blender, instant_ngp, third_coefficient, nerfstudio_fisheye, llff, colmap, colmap_text],
)
def given(request, tmp_path_factory):
    """A scene with poses, after SceneCapture and CameraPoses."""
    folder, poses = tmp_path_factory.mktemp("given"), room_poses(VIEWS)
    request.param(folder, poses)
    found = find_given_poses(folder)
    capture_photographs(folder / "images", folder / "capture", given=found)
    (folder / "out").mkdir()
    report = solve_camera_poses(
        folder / "capture",
        folder / "out",
        CameraPosesConfig(max_features=512),
        log_dir=folder / "log",
    )
    return request.param, folder, poses, report


def test_solved_cameras_have_the_poses_that_were_given(given):
    _, folder, poses, report = given
    cameras = read_cameras(folder / "out" / "cameras.parquet")
    assert (report.registered, report.total) == (VIEWS, VIEWS)
    assert report.mapper.startswith("given by")
    assert report.doubts == ()
    assert (report.lens_settings, report.focal_prior_px) == (1, None)
    for camera, pose in zip(cameras, poses, strict=True):
        np.testing.assert_allclose(camera.world_from_camera, pose, atol=1e-6)


def test_points_project_where_they_were_seen(given):
    """A wrong axis, half a pixel or a lens not heeded would show."""
    _, folder, _, report = given
    assert report.mean_reprojection_error_px < 0.5
    points = read_points(folder / "out" / "points.parquet")
    assert len(points.xyz_world) > 100
    for index, camera in enumerate(read_cameras(folder / "out" / "cameras.parquet")):
        seen = points.observed_image == index
        pixels, depth = project(camera, points.xyz_world[points.observed_point[seen]])
        assert (depth > 0).all()
        assert np.median(np.linalg.norm(pixels - points.observed_pixel[seen], axis=1)) < 0.5
    on_a_wall = np.abs(points.xyz_world).min(axis=1)
    assert np.median(on_a_wall) < 0.01, "where the room's walls are"


def test_a_published_split_is_kept_and_else_a_view_in_the_middle_is_held_out(given):
    kind, folder, _, _ = given
    table = folder / "out" / "cameras.parquet"
    train, held_out = read_split(table)
    cameras = read_cameras(table)
    rows = read_fitted_rows(table)
    assert [cameras[row].name for row in rows] == [camera.name for camera in train]
    if kind is blender:
        assert [camera.name for camera in held_out] == [f"test_r_{i}" for i in range(VIEWS // 2)]
        assert len(train) == VIEWS // 2
    else:
        assert [camera.name for camera in held_out] == [f"{VIEWS // 2}"]


def test_photographs_without_a_pose_and_poses_without_a_photograph_are_named(given):
    kind, folder, _, _ = given
    warnings = read_capture(folder / "capture").warnings
    if kind is instant_ngp:
        for name in (f"{VIEWS}.png", "extra.png"):
            assert any(mentions(warning, name) for warning in warnings)
    else:
        assert warnings == ()


def test_poses_are_named_by_their_file_or_by_their_folder_and_the_one_above(tmp_path):
    """Warnings and reports called a COLMAP model `0`."""
    for write, name in ((llff, "poses_bounds.npy"), (colmap, "sparse/0")):
        write(tmp_path / write.__name__, room_poses(4))
        (tmp_path / write.__name__ / "images").mkdir(exist_ok=True)
        found = find_given_poses(tmp_path / write.__name__)
        assert found.name == name
    (tmp_path / "colmap/images/3.png").rename(tmp_path / "colmap/images/9.png")
    found = find_given_poses(tmp_path / "colmap")
    capture_photographs(tmp_path / "colmap/images", tmp_path / "out", given=found)
    assert given_views(tmp_path / "out")[0] == "sparse/0"
    warnings = read_capture(tmp_path / "out").warnings
    assert len(warnings) == 2
    assert all(mentions(warning, "sparse/0") for warning in warnings)


def test_poses_can_be_solved_all_the_same_and_the_published_split_is_kept(tmp_path):
    """Another one was made, whose measures are not those that others publish."""
    blender(tmp_path, room_poses(VIEWS))
    found = find_given_poses(tmp_path)
    capture_photographs(tmp_path / "images", tmp_path / "capture", given=found)
    (tmp_path / "out").mkdir()
    config = CameraPosesConfig(poses="solved", max_features=512)
    report = solve_camera_poses(tmp_path / "capture", tmp_path / "out", config, log_dir=tmp_path)
    assert report.mapper in ("global", "incremental")
    _, held_out = read_split(tmp_path / "out" / "cameras.parquet")
    assert {camera.name for camera in held_out} == {f"test_r_{i}" for i in range(VIEWS // 2)}


def solved_with_rows(folder, change):
    llff(folder, room_poses(VIEWS))
    np.save(folder / "poses_bounds.npy", change(np.load(folder / "poses_bounds.npy")))
    found = find_given_poses(folder)
    capture_photographs(folder / "images", folder / "capture", given=found)
    (folder / "out").mkdir()
    return solve_camera_poses(
        folder / "capture", folder / "out", CameraPosesConfig(max_features=512)
    )


def test_poses_of_another_convention_are_refused(tmp_path):
    """Camera from world where world from camera is wanted: another center."""

    def inverted(rows):
        poses = rows[:, :15].reshape(-1, 3, 5)
        poses[:, :, 3] = -np.einsum("nji,nj->ni", poses[:, :, :3], poses[:, :, 3])
        return np.column_stack([poses.reshape(-1, 15), rows[:, 15:]])

    with rejects(Path("poses_bounds.npy")):
        solved_with_rows(tmp_path, inverted)


def test_poses_in_the_wrong_order_have_a_warning(tmp_path):
    """Along an even arc the photograph's neighbor stood about as the photograph itself."""
    report = solved_with_rows(tmp_path, lambda rows: np.roll(rows, 3, axis=0))
    assert any(re.search(r"\d%", warning) for warning in report.warnings)
