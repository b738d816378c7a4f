"""Paths are closed, smooth, made of rotations, and stay where photographs were taken."""

import numpy as np
import pytest
import torch
from captures import (
    arc,
    orbit_cameras,
    points_before,
    points_of,
    walk,
)
from expected_errors import rejects
from trajectory_captures import CAPTURES, centers_of, modeled

from styletrf.configuration import configured
from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model
from styletrf.synthetic.courtyard.capture import CourtyardConfig, courtyard_cameras
from styletrf.trajectory.trajectories import fly_through, prior_views
from styletrf.trajectory.trajectory_config import TrajectoryConfig

assert torch  # the cameras' module needs it; importing it here keeps the tests' time apart


def in_the_world(model, path, gravity) -> tuple[np.ndarray, np.ndarray]:
    """centers of a path, and the cosines between its images' down and gravity."""
    world = np.linalg.inv(model.normalized_from_world)
    rotation = world[:3, :3] / np.cbrt(np.linalg.det(world[:3, :3]))
    downs = np.stack([rotation @ camera.world_from_camera[:, 1] for camera in path])
    return centers_of(path) @ world[:3, :3].T + world[:3, 3], downs @ gravity


@pytest.mark.parametrize("capture", CAPTURES)
@pytest.mark.parametrize("turns", [1.0, 2.0, 3.0])
def test_paths_are_closed_and_smooth(capture, turns):
    views, model = modeled(capture)
    path = fly_through(views, model, TrajectoryConfig(frames=72, turns=turns))
    centers = centers_of(path)
    steps = np.linalg.norm(np.roll(centers, -1, axis=0) - centers, axis=1)
    assert steps.max() < 3 * np.median(steps) + 1e-9
    views_along = np.stack([camera.world_from_camera[:, :3] for camera in path])
    turned = np.einsum("nij,nij->n", views_along, np.roll(views_along, -1, axis=0))
    assert turned.min() > 1 + 2 * np.cos(np.radians(30))  # no frame is spun from the one before
    for rotation in views_along:
        np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1)
    taken = centers_of(views)
    reach = np.linalg.norm(taken - taken.mean(axis=0), axis=1).max()
    assert (np.linalg.norm(centers - taken.mean(axis=0), axis=1) <= 1.05 * reach).all()


@pytest.mark.parametrize("turns", [0.0, 0.5, 1.5, -1.0])
def test_turns_that_do_not_close_the_path_are_refused(turns):
    with rejects("setting 'turns'", turns):
        configured(TrajectoryConfig, {"turns": turns})


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("path_of", [fly_through, prior_views])
def test_the_orbit_of_the_courtyard_goes_around_the_vertical(seed, path_of):
    """It went around noise where the photographers looked down on the scene."""
    cameras = courtyard_cameras(CourtyardConfig(kind="orbit", seed=seed))
    points = np.random.default_rng(0).uniform([-1.2, -1.2, 0], [1.2, 1.2, 1.5], (3000, 3))
    model = decide_scene_model(cameras, points, SceneModelConfig())
    path = path_of(model.normalized(cameras), model, TrajectoryConfig(frames=24))
    centers, down = in_the_world(model, path, np.array([0.0, 0.0, -1.0]))
    taken = centers_of(cameras)
    assert taken[:, 2].min() < centers[:, 2].min() < centers[:, 2].max() < taken[:, 2].max()
    radii = np.linalg.norm(taken[:, :2], axis=1)
    np.testing.assert_allclose(np.linalg.norm(centers[:, :2], axis=1), radii.mean(), rtol=0.02)
    assert down.min() > 0.8


@pytest.mark.parametrize("path_of", [fly_through, prior_views])
@pytest.mark.parametrize("tilt", [10, 25, 35, 60])
@pytest.mark.parametrize("extent", [90, 180, 360])
def test_an_orbit_keeps_to_the_photographers_heights_distances_and_tilt(tilt, extent, path_of):
    cameras = arc(tilt, extent)
    model = decide_scene_model(cameras, points_of("block"), SceneModelConfig())
    path = path_of(model.normalized(cameras), model, TrajectoryConfig(frames=24))
    gravity = np.array([0.0, 1.0, 0.0])
    centers, down = in_the_world(model, path, gravity)
    taken = centers_of(cameras)
    assert (centers[:, 1] > taken[:, 1].min()).all()
    assert (centers[:, 1] < taken[:, 1].max()).all()
    radii = np.linalg.norm(taken[:, [0, 2]], axis=1)
    ours = np.linalg.norm(centers[:, [0, 2]], axis=1)
    assert radii.min() < ours.min() < ours.max() < radii.max()
    assert down.min() > min(camera.world_from_camera[:, 1] @ gravity for camera in cameras)


@pytest.mark.parametrize("path_of", [fly_through, prior_views])
def test_a_path_looks_out_where_the_photographers_did(path_of):
    views, model = modeled("room")
    for camera in path_of(views, model, TrajectoryConfig(frames=12)):
        outwards = camera.center_world - np.array(model.focus)
        assert camera.forward_world @ outwards > 0
        nearest = min(
            views, key=lambda view: np.linalg.norm(view.center_world - camera.center_world)
        )
        assert camera.forward_world @ nearest.forward_world > 0.9


def test_half_an_orbit_is_gone_to_and_fro():
    cameras = orbit_cameras(24)[:10]
    model = decide_scene_model(cameras, points_before(cameras), SceneModelConfig(space="box"))
    views = model.normalized(cameras)
    path = fly_through(views, model, TrajectoryConfig(frames=40))
    taken = centers_of(views)
    for camera in path:  # every frame has a photograph nearby
        distance = np.linalg.norm(taken - camera.center_world, axis=1).min()
        assert distance < 0.35 * np.linalg.norm(taken.mean(axis=0) - np.array(model.focus))


@pytest.mark.parametrize("capture", CAPTURES)
def test_no_two_priors_are_alike_and_all_are_within_the_photographs(capture):
    """Two turns of an even number of views were half as many viewpoints."""
    views, model = modeled(capture)
    taken = centers_of(views)
    extent = np.linalg.norm(np.ptp(taken, axis=0))
    for frames in range(1, 41):
        centers = centers_of(prior_views(views, model, TrajectoryConfig(frames=frames)))
        assert len(centers) == frames
        apart = np.linalg.norm(centers[:, None] - centers[None], axis=-1) + np.eye(frames) * extent
        assert apart.min() > 0.2 * extent / frames
        assert (centers >= taken.min(axis=0) - 0.01 * extent).all()
        assert (centers <= taken.max(axis=0) + 0.01 * extent).all()


@pytest.mark.parametrize("capture", CAPTURES)
def test_every_frame_of_the_fly_through_is_near_a_prior(capture):
    views, model = modeled(capture)
    priors = centers_of(prior_views(views, model, TrajectoryConfig(frames=20)))
    frames = centers_of(fly_through(views, model, TrajectoryConfig(frames=60)))
    distances = np.linalg.norm(frames[:, None] - priors[None], axis=-1).min(axis=1)
    assert distances.max() < 0.25 * np.linalg.norm(np.ptp(frames, axis=0))


def test_priors_of_a_forward_facing_scene_see_it_from_within_the_path_too():
    views, model = modeled("forward")
    priors = centers_of(prior_views(views, model, TrajectoryConfig(frames=20)))
    frames = centers_of(fly_through(views, model, TrajectoryConfig(frames=60)))
    radii = np.ptp(frames, axis=0)[:2] / 2
    fractions = np.linalg.norm((priors - centers_of(views).mean(axis=0))[:, :2] / radii, axis=1)
    np.testing.assert_allclose(np.sort(fractions) ** 2, (np.arange(20) + 0.5) / 20, atol=0.01)


@pytest.mark.parametrize("closed", [True, False])
def test_a_path_through_a_walk_goes_the_way_and_looks_as_the_photographs_near_it(closed):
    """In whatever order their names are."""
    rng = np.random.default_rng(0)
    cameras = walk(closed=closed)
    model = decide_scene_model(cameras, 3 * points_of("block"), SceneModelConfig())
    assert model.looking == "along"
    views = model.normalized(cameras)
    for shown in (views, [views[k] for k in rng.permutation(len(views))]):
        path = fly_through(shown, model, TrajectoryConfig(frames=60))
        away = np.linalg.norm(centers_of(path)[:, None] - centers_of(views), axis=-1)
        step = np.linalg.norm(np.diff(centers_of(views), axis=0), axis=1).max()
        assert away.min(axis=1).max() < 2 * step
        nearest = [views[k] for k in away.argmin(axis=1)]
        cosines = [a.forward_world @ b.forward_world for a, b in zip(path, nearest, strict=True)]
        assert min(cosines) > np.cos(np.radians(25))
