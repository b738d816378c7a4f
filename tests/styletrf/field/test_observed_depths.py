"""Rays of pixels whose depth is known end there."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from captures import forward_cameras, points_before, points_of, room, seen
from textured_scenes import textured_cameras, wall_depth, wall_picture, wall_points

from styletrf.field.kernels import Samples
from styletrf.field.training.observed_depths import (
    DENSE_WINDOW,
    MANY,
    SPARSE_WINDOW,
    UNEXPLAINED,
    ObservedDepths,
    depth_loss,
    observed_depths,
)
from styletrf.field.view_rays import ViewRays
from styletrf.geometry.cameras import project
from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model

CPU = torch.device("cpu")


def of_points(model, cameras, points) -> ObservedDepths:
    """Returns the depths of photographs without texture, which have those of points alone."""
    gray = [np.full((camera.height, camera.width, 3), 0.5) for camera in cameras]
    return observed_depths(model, cameras, points, gray, [None] * len(cameras))


@pytest.fixture(scope="module")
def observed():
    """A room's model, cameras, and the depths of its points."""
    cameras, points = room(0), points_of("room")
    model = decide_scene_model(cameras, points, SceneModelConfig(space="unbounded"))
    return model, cameras, of_points(model, cameras, seen(cameras, points))


def along(segments, fraction: torch.Tensor, weights: torch.Tensor) -> Samples:
    """One sample a ray, at a share of its length, of a weight."""
    ray = torch.arange(len(segments))
    positions = segments.positions_at(ray, fraction)
    return Samples(torch.arange(len(segments) + 1), ray, fraction, positions, weights)


def rays_of(observed):
    model, cameras, depths = observed
    rays = ViewRays(model.normalized(cameras), model.space, 0.01, CPU)
    return rays.segments(depths.view, depths.pixel), depths


def fraction_at(segments, depth: torch.Tensor) -> torch.Tensor:
    """Returns where along the rays a depth is, by bisection."""
    ray = torch.arange(len(segments))
    low, high = torch.zeros(len(ray)), torch.ones(len(ray))
    for _ in range(40):
        middle = (low + high) / 2
        beyond = segments.depth_along(ray, middle) > depth
        low, high = torch.where(beyond, low, middle), torch.where(beyond, middle, high)
    return low


def test_depth_is_that_of_the_projected_point(observed):
    model, cameras, depths = observed
    normalized = model.normalized(cameras)
    matrix = model.normalized_from_world
    points = points_of("room") @ matrix[:3, :3].T + matrix[:3, 3]
    _, expected = project(normalized[0], points)
    of_view = depths.depth[depths.view == 0].numpy()
    assert len(of_view) > 0
    assert np.isclose(of_view[:, None], expected[None], rtol=1e-5).any(axis=1).all()


@pytest.mark.parametrize(
    ("where", "expected"), [(1.0, 0.0), (1 - 2 * SPARSE_WINDOW, 2.0), (1 + 2 * SPARSE_WINDOW, 1.0)]
)
def test_sparse_loss_of_an_opaque_sample_tells_where_it_is(observed, where, expected):
    """0 at the point, 1 behind it, 2 before it."""
    assert loss_of_opaque_samples(observed, where, are_dense=False) == pytest.approx(
        expected, abs=1e-5
    )


WORST = -math.log(UNEXPLAINED / (1 + UNEXPLAINED))


@pytest.mark.parametrize(
    ("where", "expected"),
    [(1.0, 0.0), (1 - 2 * DENSE_WINDOW, WORST), (1 + 2 * DENSE_WINDOW, WORST)],
)
def test_dense_loss_of_an_opaque_sample_is_0_at_its_depth_and_bounded(observed, where, expected):
    assert loss_of_opaque_samples(observed, where, are_dense=True) == pytest.approx(
        expected, abs=1e-5
    )


def loss_of_opaque_samples(observed, where: float, *, are_dense: bool) -> float:
    """Returns the loss of rays that end at a share of their depths."""
    segments, depths = rays_of(observed)
    fraction = fraction_at(segments, where * depths.depth)
    reachable = (segments.depth_along(torch.arange(len(fraction)), fraction) / depths.depth) - where
    there = reachable.abs() < 1e-3
    assert there.float().mean() > 0.9
    chosen = segments[there]
    samples = along(chosen, fraction[there], torch.ones(int(there.sum())))
    kept = replace(depths, depth=depths.depth[there], are_dense=are_dense)
    return float(depth_loss(samples, chosen, kept))


def test_sparse_gradient_pulls_matter_from_before_a_point_to_it(observed):
    segments, depths = rays_of(observed)
    for where, sign in ((1.0, -1), (0.7, 1)):
        weights = torch.full((len(segments),), 0.5, requires_grad=True)
        samples = along(segments, fraction_at(segments, where * depths.depth), weights)
        depth_loss(samples, segments, depths).backward()
        assert (sign * weights.grad >= 0).all()
        assert (sign * weights.grad > 0).float().mean() > 0.9


def test_the_less_matter_is_at_a_dense_depth_the_more_it_is_pulled_there(observed):
    """The sparse loss emptied the rays instead: 14 dB of 8 photographs of horns."""
    segments, depths = rays_of(observed)
    pulls = []
    for weight in (0.01, 0.5):
        weights = torch.full((len(segments),), weight, requires_grad=True)
        samples = along(segments, fraction_at(segments, depths.depth), weights)
        depth_loss(samples, segments, replace(depths, are_dense=True)).backward()
        assert (weights.grad <= 0).all()
        pulls.append(-float(weights.grad.sum()))
    assert pulls[0] == pytest.approx(pulls[1] * (0.5 + UNEXPLAINED) / (0.01 + UNEXPLAINED))


def test_rays_that_meet_nothing_have_sparse_loss_1_and_the_greatest_dense_loss(observed):
    segments, depths = rays_of(observed)
    nothing = along(segments, torch.zeros(len(segments)), torch.zeros(len(segments)))
    assert float(depth_loss(nothing, segments, depths)) == 1
    dense = depth_loss(nothing, segments, replace(depths, are_dense=True))
    assert float(dense) == pytest.approx(WORST)


def test_images_without_points_have_no_observed_depths(observed):
    model, cameras, _ = observed
    tracks = seen(cameras, points_of("room"))
    assert len(of_points(model, cameras, tracks.of_images([]))) == 0


def test_depths_of_stereo_are_those_of_the_surface_at_the_working_size():
    cameras = textured_cameras()
    points = wall_points(cameras)
    config = SceneModelConfig(space="ndc", image_long_side=48)
    model = decide_scene_model(cameras, points.xyz_world, config)
    pictures = map(wall_picture, cameras)
    depths = observed_depths(model, cameras, points.of_images([]), pictures, [None] * 5)
    assert len(depths) == 0
    depths = observed_depths(model, cameras, points, map(wall_picture, cameras), [None] * 5)
    assert len(depths) > 2 * len(points.observed_point)
    for k, camera in enumerate(model.normalized(cameras)):
        of_view = depths.view == k
        column, row = (2 * depths.pixel[of_view]).floor().long().T
        exact = wall_depth(cameras[k])[row, column]
        scale = float(np.cbrt(np.linalg.det(model.normalized_from_world[:3, :3])))
        errors = depths.depth[of_view].numpy() / (scale * exact) - 1
        assert camera.width == 48
        assert np.quantile(np.abs(errors), 0.9) < 0.03


@pytest.mark.parametrize(("n", "has_depths"), [(MANY - 1, True), (MANY, False)])
def test_in_ndc_few_photographs_have_depths(n, has_depths):
    """Of 51 photographs of horns a rope near the camera was lost."""
    cameras = forward_cameras(n)
    points = points_before(cameras)
    model = decide_scene_model(cameras, points, SceneModelConfig(space="ndc"))
    assert (len(of_points(model, cameras, seen(cameras, points))) > 0) == has_depths


def test_points_of_images_are_numbered_in_the_order_given():
    tracks = seen(room(0), points_of("room"))
    chosen = tracks.of_images([3, 1])
    assert set(chosen.observed_image) == {0, 1}
    for number, image in enumerate([3, 1]):
        for name in ("observed_point", "observed_pixel"):
            np.testing.assert_array_equal(
                getattr(chosen, name)[chosen.observed_image == number],
                getattr(tracks, name)[tracks.observed_image == image],
            )
