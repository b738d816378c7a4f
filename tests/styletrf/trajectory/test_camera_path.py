"""Frames along named paths and along files: length, shape, speed, and where they are."""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from captures import looking
from expected_errors import rejects
from mini_scene import painted_plane
from trajectory_captures import CAPTURES, centers_of, modeled

from styletrf.configuration import configured
from styletrf.geometry.cameras import Camera
from styletrf.geometry.lenses import at_size, focal_of
from styletrf.trajectory.camera_curve import curve_through
from styletrf.trajectory.camera_path import TimedPath, frames_along, timed
from styletrf.trajectory.chosen_path import chosen_path
from styletrf.trajectory.frames import FramesConfig
from styletrf.trajectory.key_frames import KeyFrame, KeyFrames
from styletrf.trajectory.named_paths import named_path, poses_of
from styletrf.trajectory.trajectories import fly_through
from styletrf.trajectory.trajectory_config import TrajectoryConfig

painted_plane = cache(painted_plane)
NAMES = ("orbit", "spiral", "dolly", "photographs")
CONFIG = FramesConfig(trajectory=TrajectoryConfig(frames=40))


def assert_cameras(cameras) -> None:
    rotations = np.stack([camera.world_from_camera[:, :3] for camera in cameras])
    products = rotations.transpose(0, 2, 1) @ rotations
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), products.shape), atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(rotations), 1, rtol=1e-6)
    assert np.isfinite(centers_of(cameras)).all()
    assert all(camera.fx > 0 for camera in cameras)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("capture", CAPTURES)
def test_every_named_path_is_even_and_near_the_photographs(name, capture):
    views, model = modeled(capture)
    path = chosen_path(name, views, model, CONFIG, are_given=False)
    assert len(path) == 40
    assert_cameras(path)
    taken = centers_of(views)
    reach = np.linalg.norm(taken - np.array(model.focus), axis=1).max() + model.space.depth_min
    assert (np.linalg.norm(centers_of(path) - np.array(model.focus), axis=1) <= 1.2 * reach).all()
    steps = np.linalg.norm(np.diff(centers_of(path), axis=0), axis=1)
    assert steps.max() < 3 * steps.mean() + 1e-9


DEGENERATE = {
    "one": lambda cameras: cameras[:1],
    "two": lambda cameras: cameras[:2],
    "at one point": lambda cameras: [
        replace(
            camera,
            world_from_camera=np.column_stack(
                [camera.world_from_camera[:, :3], cameras[0].center_world]
            ),
        )
        for camera in cameras
    ],
    "the same one": lambda cameras: cameras[:1] * 5,
    "at the focus": lambda cameras: [
        replace(
            camera,
            world_from_camera=np.column_stack(
                [camera.world_from_camera[:, :3], np.array(painted_plane().model.focus)]
            ),
        )
        for camera in cameras
    ],
}


@pytest.mark.parametrize(
    ("name", "looking"),
    [
        *(("auto", looking) for looking in ("ahead", "inward", "outward", "along")),
        *product(("orbit", "spiral"), ("ahead", "inward", "outward")),
        ("dolly", "ahead"),  # the model's looking has no part in these two
        ("photographs", "ahead"),
    ],
)
@pytest.mark.parametrize("some", DEGENERATE)
def test_named_paths_of_degenerate_cameras_are_finite(name, some, looking):
    scene = painted_plane()
    cameras, model = DEGENERATE[some](scene.cameras), replace(scene.model, looking=looking)
    if name == "auto":
        assert_cameras(fly_through(cameras, model, CONFIG.trajectory))
    else:
        assert_cameras(chosen_path(name, cameras, model, CONFIG, are_given=False))


def test_photographs_without_smoothing_are_passed_one_by_one_in_their_order():
    views, model = modeled("way")
    found = named_path("photographs", views, model, TrajectoryConfig(stabilization=0.0)).poses
    np.testing.assert_allclose(found.centers, centers_of(views))


def test_stabilization_leaves_less_shaking():
    views, model = modeled("arc")

    def shaking(deviation: float) -> float:
        config = replace(CONFIG, trajectory=TrajectoryConfig(frames=80, stabilization=deviation))
        path = chosen_path("photographs", views, model, config, are_given=False)
        return float(np.linalg.norm(np.diff(centers_of(path), n=2, axis=0), axis=1).mean())

    assert shaking(0.0) > 2 * shaking(1.5) > 2 * shaking(6.0)


def test_a_dolly_is_straight_and_looks_one_way():
    views, model = modeled("forward")
    path = chosen_path("dolly", views, model, CONFIG, are_given=False)
    way = centers_of(path) - path[0].center_world
    along = way @ path[0].forward_world
    np.testing.assert_allclose(way, np.outer(along, path[0].forward_world), atol=1e-9)
    assert (np.diff(along) > 0).all()
    assert path[-1].forward_world == pytest.approx(path[0].forward_world)


@pytest.mark.parametrize("name", ["orbit", "spiral"])
def test_an_orbit_and_a_spiral_return(name):
    views, model = modeled("ring")
    path = chosen_path(name, views, model, CONFIG, are_given=False)
    steps = np.linalg.norm(np.diff(centers_of([*path, path[0]]), axis=0), axis=1)
    assert steps[-1] == pytest.approx(steps.mean(), rel=0.2)


@pytest.mark.parametrize(
    ("words", "count"),
    [
        ({}, 60),
        ({"trajectory.speed": 2.0}, 30),
        ({"trajectory.seconds": 2.0}, 48),
        ({"trajectory.seconds": 2.0, "frames_per_second": 60}, 120),
        ({"trajectory.seconds": 2.0, "trajectory.speed": 0.5}, 96),
        ({"trajectory.speed": 1e9}, 1),
    ],
)
def test_length_rate_and_speed_decide_the_number_of_frames(words, count):
    views, model = modeled("forward")
    config = configured(FramesConfig, words)
    assert len(chosen_path("orbit", views, model, config, are_given=False)) == count


@pytest.mark.parametrize(
    "words",
    [
        {"trajectory.seconds": -1.0}, {"trajectory.seconds": float("nan")},
        {"trajectory.speed": 0.0}, {"trajectory.easing": 1.5}, {"trajectory.fov_deg": 180.0},
        {"trajectory.stabilization": -1.0}, {"frames_per_second": 23}, {"frames_per_second": 61},
        {"long_side_px": 63}, {"long_side_px": 4096}, {"support.depth_px": 0},
    ],
)  # fmt: skip
def test_values_out_of_range_are_refused(words):
    with rejects(f"setting {next(iter(words))!r}"):
        configured(FramesConfig, words)


@pytest.mark.parametrize("fov_deg", [20.0, 90.0])
def test_the_angle_of_view_is_along_the_longer_side(fov_deg):
    for width, height in ((64, 48), (48, 64)):
        camera = at_size(Camera("c", width, height, 50.0, 50.0, 1.0, 2.0, np.eye(3, 4)), 0, fov_deg)
        longer = max(width, height)
        focal_px = camera.fx
        assert 2 * np.degrees(np.arctan(longer / 2 / focal_px)) == pytest.approx(fov_deg)
        assert (camera.cx, camera.cy) == (width / 2, height / 2)


def test_frames_may_be_larger_than_the_photographs():
    camera = at_size(Camera("c", 64, 48, 50.0, 50.0, 32.0, 24.0, np.eye(3, 4)), 3840, 0.0)
    assert (camera.width, camera.height) == (3840, 2880)
    assert focal_of(camera) == pytest.approx(50 / 64)


def test_timed_key_frames_are_met_at_their_frames():
    views, _ = modeled("walk")
    path = TimedPath(poses_of(views[:4]), times_s=(0.0, 0.5, 1.0, 3.0))
    frames = frames_along(path, views[0], TrajectoryConfig(), 24)
    assert len(frames) == 3 * 24 + 1
    for view, time_s in zip(views, path.times_s, strict=False):
        frame = frames[round(24 * time_s)]
        np.testing.assert_allclose(frame.world_from_camera, view.world_from_camera, atol=1e-9)


def test_a_path_waits_at_its_first_key_frame_until_the_time_of_that():
    """It started there at once, though times count from the beginning of the path."""
    views, _ = modeled("walk")
    frames = tuple(KeyFrame(view.name, time_s=2.0 + k) for k, view in enumerate(views[:3]))
    path = timed(KeyFrames("p.json", frames), poses_of(views[:3]))
    found = frames_along(path, views[0], TrajectoryConfig(), 24)
    assert len(found) == 4 * 24 + 1
    for frame in found[: 2 * 24 + 1]:
        np.testing.assert_allclose(frame.world_from_camera, views[0].world_from_camera, atol=1e-5)
    for k in range(3):
        np.testing.assert_allclose(
            found[24 * (2 + k)].world_from_camera, views[k].world_from_camera, atol=1e-9
        )


@pytest.mark.parametrize("turns", [2.0, 8.0, 48.0])
def test_a_spiral_of_many_turns_stays_on_its_ellipse(turns):
    """So many key frames as a few turns need left a star, or a point."""
    views, model = modeled("forward")
    named = named_path("spiral", views, model, TrajectoryConfig(turns=turns))
    curve = curve_through(named.poses, closed=named.closed)
    found = curve.at(np.linspace(*curve.key_knots[[0, -1]], 3001)).centers[:, :2]
    radii = np.ptp(named.poses.centers[:, :2], axis=0) / 2
    around = np.linalg.norm((found - centers_of(views)[:, :2].mean(axis=0)) / radii, axis=1)
    np.testing.assert_allclose(around, 1, atol=0.03)


@pytest.mark.parametrize("n", [6, 8, 12, 20, 40])
def test_a_round_of_photographs_keeps_its_radius_however_few_they_are(n):
    turn = 2 * np.pi * np.arange(n) / n
    ring = [looking(3 * np.array([np.sin(a), 0, np.cos(a)]), np.zeros(3)) for a in turn]
    found = named_path("photographs", ring, modeled("ring")[1], TrajectoryConfig())
    assert found.closed
    assert np.linalg.norm(found.poses.centers, axis=1).min() > 0.9 * 3
