"""Poses that came with photographs of the room, exact or not, after CameraPoses."""

from pathlib import Path

import cv2
import numpy as np
import pycolmap
import pytest
from made_photographs import encoded, room_poses, room_view

from styletrf.capture.poses.given_poses import GivenPoses, GivenView, Lens
from styletrf.capture.scene_capture import capture_photographs
from styletrf.geometry.camera_table import read_cameras
from styletrf.sfm import pose_adjustment
from styletrf.sfm.camera_poses import CameraPosesConfig, solve_camera_poses

VIEWS, WIDTH, HEIGHT, FOCAL = 8, 320, 240, 260.0
LENS = Lens("PINHOLE", (FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2), WIDTH, HEIGHT)
BENT = pycolmap.Camera(
    model="SIMPLE_RADIAL",
    width=WIDTH,
    height=HEIGHT,
    params=[FOCAL, WIDTH / 2, HEIGHT / 2, 0.05],
)
PINHOLE = pycolmap.Camera(model=LENS.model, width=WIDTH, height=HEIGHT, params=LENS.params)


def solved(folder, lens, given, poses="auto"):
    """CameraPoses of photographs of the room's true poses, with those given; also the cameras."""
    (folder / "images").mkdir()
    views = []
    for index, (true, pose) in enumerate(zip(room_poses(VIEWS), given, strict=True)):
        file = folder / "images" / f"{index}.png"
        file.write_bytes(encoded(room_view(true, lens), ".png"))
        views.append(GivenView(file, LENS, pose))
    found = GivenPoses(folder / "poses.json", tuple(views))
    found.source.write_text("{}")
    capture_photographs(folder / "images", folder / "capture", given=found)
    (folder / "out").mkdir()
    config = CameraPosesConfig(poses=poses, max_features=384)
    report = solve_camera_poses(folder / "capture", folder / "out", config, log_dir=folder / "log")
    return report, read_cameras(folder / "out" / "cameras.parquet")


def disturbed(poses, angle_deg, fraction, seed=0):
    """Poses turned by an angle and moved by a share of their extent, each its own way."""
    rng, extent = np.random.default_rng(seed), np.linalg.norm(np.ptp(poses[:, :, 3], axis=0))
    turns, moves = rng.normal(size=(2, len(poses), 3))
    turns *= np.radians(angle_deg) / np.linalg.norm(turns, axis=1, keepdims=True)
    moves *= fraction * extent / np.linalg.norm(moves, axis=1, keepdims=True)
    rotations = [p[:, :3] @ cv2.Rodrigues(turn)[0] for p, turn in zip(poses, turns, strict=True)]
    return np.concatenate([rotations, (poses[:, :, 3] + moves)[:, :, None]], axis=2)


def relative_error_deg(cameras, poses):
    """The median error of the rotations between neighbors: whatever the frame of the world."""
    found = np.stack([camera.world_from_camera[:, :3] for camera in cameras])
    apart = [
        (a.T @ b).T @ (c.T @ d)
        for a, b, c, d in zip(found, found[1:], poses[:, :, :3], poses[1:, :, :3], strict=False)
    ]
    return np.median([np.degrees(np.linalg.norm(cv2.Rodrigues(turn)[0])) for turn in apart])


def test_exact_poses_stay_as_they_are(tmp_path):
    report, cameras = solved(tmp_path, PINHOLE, room_poses(VIEWS))
    assert report.mapper_reason == "the poses came with the photographs"
    for camera, pose in zip(cameras, room_poses(VIEWS), strict=True):
        np.testing.assert_allclose(camera.world_from_camera, pose, atol=1e-9)


@pytest.mark.parametrize(("angle_deg", "fraction"), [(0.1, 0.002), (0.5, 0.02)])
def test_disturbed_poses_are_recovered_in_the_frame_they_came_in(tmp_path, angle_deg, fraction):
    true = room_poses(VIEWS)
    given = disturbed(true, angle_deg, fraction)
    report, cameras = solved(tmp_path, PINHOLE, given)
    assert "adjusted" in report.mapper_reason
    assert relative_error_deg(cameras, true) < 0.05
    centers = np.stack([camera.center_world for camera in cameras])
    extent = np.linalg.norm(np.ptp(true[:, :, 3], axis=0))
    assert np.linalg.norm(centers - true[:, :, 3], axis=1).max() < 2 * fraction * extent


def test_of_many_points_some_adjust_and_judge(tmp_path, monkeypatch):
    """The poses of 62 photographs took 7 s to be adjusted by all of theirs."""
    monkeypatch.setattr(pose_adjustment, "_POINTS_PER_IMAGE", 50)
    true = room_poses(VIEWS)
    report, cameras = solved(tmp_path, PINHOLE, disturbed(true, 0.5, 0.02))
    assert "adjusted" in report.mapper_reason
    assert report.points > 50 * VIEWS, "and all of them stay"
    assert relative_error_deg(cameras, true) < 0.1


def test_the_sums_of_an_adjustment_have_one_order(monkeypatch):
    """Of large captures several threads made them, and each run had other poses."""
    threads = []

    def adjust(_, options):
        threads.append(options.ceres.solver_options.num_threads)

    def triangulate(model, *_, options):
        threads.append(options.num_threads)
        return model

    monkeypatch.setattr(pycolmap, "bundle_adjustment", adjust)
    monkeypatch.setattr(pycolmap, "triangulate_points", triangulate)
    monkeypatch.setattr(pose_adjustment, "explained_fraction", lambda *_: 0.0)
    model, folder = pycolmap.Reconstruction(), Path("images")
    pose_adjustment.adjusted_poses(model, Path("colmap.db"), folder, long_side=1600, seed=0)
    assert set(threads) == {1}


def test_a_distortion_that_the_format_leaves_out_is_found(tmp_path):
    report, _ = solved(tmp_path, BENT, room_poses(VIEWS))
    focal, _, _, distortion = report.camera_params
    assert focal == pytest.approx(FOCAL, rel=0.01)
    assert distortion == pytest.approx(0.05, abs=0.01)
    assert report.mean_reprojection_error_px < 0.5


def test_poses_that_are_to_be_used_as_given_are_not_adjusted(tmp_path):
    given = disturbed(room_poses(VIEWS), 0.1, 0.002)
    report, cameras = solved(tmp_path, PINHOLE, given, "given")
    assert report.mapper_reason == "the poses came with the photographs"
    for camera, pose in zip(cameras, given, strict=True):
        np.testing.assert_allclose(camera.world_from_camera, pose, atol=1e-6)


def test_poses_in_the_reverse_order_stay_wrong_and_there_is_a_warning(tmp_path):
    report, _ = solved(tmp_path, PINHOLE, room_poses(VIEWS)[::-1])
    assert report.mapper_reason == "the poses came with the photographs"
    assert report.warnings
