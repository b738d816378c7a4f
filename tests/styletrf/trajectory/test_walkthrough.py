"""The way through panoramas: from place to place, looking ahead."""

from dataclasses import replace

import numpy as np
import pytest
from captures import points_of, walk

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
