"""Paths are closed, smooth, made of rotations, and stay where photographs were taken."""

import numpy as np
import pytest
import torch
from test_space import forward_cameras, orbit_cameras, points_before

from styletrf.scene_model import SceneModelConfig, decide_scene_model
from styletrf.trajectories import TrajectoryConfig, fly_through

assert torch  # the cameras' module needs it; importing it here keeps the tests' time apart


@pytest.mark.parametrize("cameras_of", [forward_cameras, orbit_cameras])
@pytest.mark.parametrize("turns", [1.0, 2.0])
def test_paths_are_closed_and_smooth(cameras_of, turns):
    cameras = cameras_of()
    model = decide_scene_model(cameras, points_before(cameras), SceneModelConfig())
    views = model.normalized(cameras)
    path = fly_through(views, model, TrajectoryConfig(frames=48, turns=turns))
    centers = np.stack([camera.center_world for camera in path])
    steps = np.linalg.norm(np.roll(centers, -1, axis=0) - centers, axis=1)
    assert steps.max() < 3 * np.median(steps) + 1e-9
    for camera in path:
        rotation = camera.world_from_camera[:, :3]
        np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1)
    taken = np.stack([camera.center_world for camera in views])
    reach = np.linalg.norm(taken - taken.mean(axis=0), axis=1).max()
    assert (np.linalg.norm(centers - taken.mean(axis=0), axis=1) <= 1.05 * reach).all()


def test_half_an_orbit_is_gone_to_and_fro():
    cameras = orbit_cameras(24)[:10]
    model = decide_scene_model(cameras, points_before(cameras), SceneModelConfig(space="box"))
    views = model.normalized(cameras)
    path = fly_through(views, model, TrajectoryConfig(frames=40))
    taken = np.stack([camera.center_world for camera in views])
    for camera in path:  # every frame has a photograph nearby
        distance = np.linalg.norm(taken - camera.center_world, axis=1).min()
        assert distance < 0.35 * np.linalg.norm(taken.mean(axis=0) - np.array(model.focus))
