"""The way through panoramas: from place to place, looking ahead."""

from dataclasses import replace

import numpy as np
import pytest
from captures import looking, points_of, walk
from trajectory_captures import modeled

from styletrf.capture.panorama.panorama_views import DIRECTIONS, view_camera
from styletrf.geometry.cameras import moved
from styletrf.geometry.rotations import matrices_of
from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model
from styletrf.trajectory.named_paths import named_path
from styletrf.trajectory.trajectory_config import TrajectoryConfig
from styletrf.trajectory.walkthrough import looks_all_around, onwards, smoothed_walkthrough


def panoramas(centers, yaw_rad=0.7):
    """Views of upright panoramas at the centers."""
    turn = np.eye(4)
    turn[[0, 0, 2, 2], [0, 2, 0, 2]] = np.array([1, 1, -1, 1]) * [
        np.cos(yaw_rad), np.sin(yaw_rad), np.sin(yaw_rad), np.cos(yaw_rad),
    ]  # fmt: skip
    return [
        replace(
            camera := moved(view_camera(direction, 256), turn),
            world_from_camera=np.column_stack([camera.world_from_camera[:, :3], center]),
        )
        for center in centers
        for direction in DIRECTIONS
    ]


def straight(count=8):
    return np.column_stack([np.arange(float(count)), np.zeros(count), np.full(count, 5.0)])


def test_views_of_panoramas_look_all_around_and_photographs_do_not():
    assert looks_all_around(panoramas(straight()))
    assert not looks_all_around(walk())
    assert not looks_all_around(panoramas(straight())[:: len(DIRECTIONS)])


@pytest.mark.parametrize("yaw_rad", [0.0, 0.7, 3.0])
def test_a_path_through_panoramas_looks_ahead_wherever_they_faced(yaw_rad):
    cameras = panoramas(straight(), yaw_rad)
    centers, ahead = smoothed_walkthrough(cameras, np.linspace(0, 1, 40), back=True)
    assert np.abs(centers[:, 1:] - [0, 5]).max() < 1e-9
    assert ahead == pytest.approx(np.tile([[1.0, 0.0, 0.0]], (40, 1)))
    assert np.ptp(centers[:, 0]) > 4


def test_a_round_of_panoramas_is_gone_along_its_tangent():
    turn = 2 * np.pi * np.arange(16) / 16
    centers = np.column_stack([np.cos(turn), 0 * turn, np.sin(turn)])
    places, ahead = smoothed_walkthrough(panoramas(centers), np.arange(48) / 48, back=False)
    assert np.abs((places * ahead).sum(axis=1)).max() < 1e-3
    assert np.linalg.norm(ahead, axis=1) == pytest.approx(np.ones(48))


def test_the_path_of_the_photographs_goes_through_panoramas_once():
    cameras = panoramas(straight())
    config = TrajectoryConfig(stabilization=0.0)
    model = decide_scene_model(cameras, 3 * points_of("block"), SceneModelConfig())
    path = named_path("photographs", cameras, model, config)
    assert path.poses.centers == pytest.approx(straight())
    forward = matrices_of(path.poses.quaternions)[:, :, 2]
    assert forward == pytest.approx(np.tile([[1.0, 0.0, 0.0]], (8, 1)))


def test_panoramas_of_one_place_have_a_way_that_is_finite():
    centers, ahead = onwards(panoramas(straight(1)))
    assert centers.shape == ahead.shape == (1, 3)
    assert np.isfinite(
        smoothed_walkthrough(panoramas(straight(1)), np.arange(5) / 5, back=True)
    ).all()


SIDES = {
    "left and right": [(1, 0, 0), (-1, 0, 0)],
    "ahead and back": [(0, 0, 1), (0, 0, -1)],
    "twice left, twice right": [(1, 0, 0), (1, 0, 0), (-1, 0, 0), (-1, 0, 0)],
    "to four sides": [(1, 0, 0), (0, 0, 1), (-1, 0, 0), (0, 0, -1)],
}


def corridor(sides, count=40, *, in_spots):
    """Handheld photographs along a corridor that look to sides by turns, or from spots to all."""
    rng, cameras = np.random.default_rng(0), []
    for k in range(count):
        along = k // len(sides) * len(sides) if in_spots else k
        center = np.array([0, 0, 0.1 * along]) + rng.normal(0, 0.02, 3)
        side = np.array(sides[k % len(sides)]) + rng.normal(0, 0.05, 3)
        cameras.append(looking(center, center + side))
    return cameras


@pytest.mark.parametrize("sides", SIDES.values(), ids=SIDES)
@pytest.mark.parametrize("in_spots", [False, True])
def test_a_path_through_photographs_that_look_to_several_sides_looks_ahead(sides, in_spots):
    """It spun: the mean of such directions is nearly nothing, and was taken for a direction."""
    cameras = corridor(sides, in_spots=in_spots)
    _, ahead = smoothed_walkthrough(cameras, np.linspace(0, 1, 60), back=False)
    assert ahead[:, 2].min() > np.cos(np.radians(30))
    poses = named_path("photographs", cameras, modeled("way")[1], TrajectoryConfig()).poses
    assert matrices_of(poses.quaternions)[:, 2, 2].min() > np.cos(np.radians(30))


@pytest.mark.parametrize("count", [6, 8])
def test_a_short_way_along_which_photographs_look_left_and_right_looks_ahead(count):
    """Hardly smoothed, as a round of so few is, the path spun."""
    cameras = corridor(SIDES["left and right"], count, in_spots=False)
    _, ahead = smoothed_walkthrough(cameras, np.linspace(0, 1, 60), back=False)
    poses = named_path("photographs", cameras, modeled("way")[1], TrajectoryConfig()).poses
    for directions in (ahead, matrices_of(poses.quaternions)[:, :, 2]):
        assert directions[:, 2].min() > np.cos(np.radians(30))


@pytest.mark.parametrize("count", [7, 8, 12])
@pytest.mark.parametrize("side", [1, -1])
def test_a_round_of_few_photographs_is_gone_looking_as_they_do(count, side):
    """Neighbors far apart on it look in other directions, but not all around."""
    turn = 2 * np.pi * np.arange(count) / count
    centers = np.column_stack([np.cos(turn), 0 * turn, np.sin(turn)])
    cameras = [looking(center, (1 + side) * center) for center in centers]
    assert not looks_all_around(cameras)
    places, ahead = smoothed_walkthrough(cameras, np.arange(48) / 48, back=False)
    outward = places / np.linalg.norm(places, axis=1, keepdims=True)
    assert side * (outward * ahead).sum(axis=1).min() > 0.99


ARCS = [(3, 180), (5, 180), (5, 240), (8, 240), (12, 240), (3, 360), (4, 360), (12, 360)]


@pytest.mark.parametrize("in_order", [True, False])
@pytest.mark.parametrize("stabilization", [0.0, 1.5, 5.0])
@pytest.mark.parametrize(("count", "extent_deg"), ARCS)
def test_a_path_through_photographs_around_an_object_looks_at_it(
    count, extent_deg, stabilization, in_order
):
    """Far apart or smoothed much, their directions cancel as those of panoramas do."""
    turn = np.radians(np.linspace(0, extent_deg, count, endpoint=extent_deg < 360))
    turn = turn if in_order else np.random.default_rng(0).permutation(turn)
    centers = 3 * np.column_stack([np.cos(turn), 0 * turn, np.sin(turn)])
    cameras = [looking(center, np.zeros(3)) for center in centers]
    model = decide_scene_model(cameras, points_of("block"), SceneModelConfig())
    config = TrajectoryConfig(stabilization=stabilization)
    poses = named_path("photographs", model.normalized(cameras), model, config).poses
    to_object = np.array(model.focus) - poses.centers
    to_object /= np.linalg.norm(to_object, axis=1, keepdims=True)
    assert (matrices_of(poses.quaternions)[:, :, 2] * to_object).sum(axis=1).min() > 0.99


def test_photographs_that_look_to_several_sides_are_passed_as_they_are_without_smoothing():
    cameras = corridor(SIDES["left and right"], in_spots=False)
    poses = named_path(
        "photographs", cameras, modeled("way")[1], TrajectoryConfig(stabilization=0.0)
    ).poses
    forward = matrices_of(poses.quaternions)[:, :, 2]
    assert forward == pytest.approx(np.stack([camera.forward_world for camera in cameras]))
