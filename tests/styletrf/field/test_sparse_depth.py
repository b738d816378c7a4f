"""Rays through sparse points end at their depths."""

import numpy as np
import pytest
import torch
from captures import forward_cameras, points_before, points_of, room, seen

from styletrf.field.kernels import Samples
from styletrf.field.training.sparse_depth import DEPTH_WINDOW, depth_loss, sparse_depths
from styletrf.field.view_rays import ViewRays
from styletrf.geometry.cameras import project
from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model

CPU = torch.device("cpu")


@pytest.fixture(scope="module")
def observed():
    """A room's model, cameras, and the depths of its points."""
    cameras, points = room(0), points_of("room")
    model = decide_scene_model(cameras, points, SceneModelConfig(space="unbounded"))
    return model, cameras, sparse_depths(model, cameras, seen(cameras, points))


def along(segments, share: torch.Tensor, weights: torch.Tensor) -> Samples:
    """One sample a ray, at a share of its length, of a weight."""
    ray = torch.arange(len(segments))
    positions = segments.positions_at(ray, share)
    return Samples(torch.arange(len(segments) + 1), ray, share, positions, weights)


def rays_of(observed):
    model, cameras, depths = observed
    rays = ViewRays(model.normalized(cameras), model.space, 0.01, CPU)
    return rays.segments(depths.view, depths.pixel), depths


def share_at(segments, depth: torch.Tensor) -> torch.Tensor:
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
    ("where", "expected"), [(1.0, 0.0), (1 - 2 * DEPTH_WINDOW, 2.0), (1 + 2 * DEPTH_WINDOW, 1.0)]
)
def test_loss_of_an_opaque_sample_tells_where_it_is(observed, where, expected):
    """0 at the point, 1 behind it, 2 before it."""
    segments, depths = rays_of(observed)
    share = share_at(segments, where * depths.depth)
    reachable = (segments.depth_along(torch.arange(len(share)), share) / depths.depth) - where
    there = reachable.abs() < 1e-3
    assert there.float().mean() > 0.9
    chosen = segments[there]
    samples = along(chosen, share[there], torch.ones(int(there.sum())))
    loss = depth_loss(samples, chosen, depths.depth[there])
    assert float(loss) == pytest.approx(expected, abs=1e-5)


def test_gradient_pulls_matter_from_before_a_point_to_it(observed):
    segments, depths = rays_of(observed)
    for where, sign in ((1.0, -1), (0.7, 1)):
        weights = torch.full((len(segments),), 0.5, requires_grad=True)
        samples = along(segments, share_at(segments, where * depths.depth), weights)
        depth_loss(samples, segments, depths.depth).backward()
        assert (sign * weights.grad >= 0).all()
        assert (sign * weights.grad > 0).float().mean() > 0.9


def test_rays_that_meet_nothing_have_loss_1(observed):
    segments, depths = rays_of(observed)
    nothing = along(segments, torch.zeros(len(segments)), torch.zeros(len(segments)))
    assert float(depth_loss(nothing, segments, depths.depth)) == 1


def test_no_points_no_depths(observed):
    model, cameras, _ = observed
    tracks = seen(cameras, points_of("room"))
    assert len(sparse_depths(model, cameras, tracks.of_images([]))) == 0


def test_frustum_has_none():
    """Matter in NDC is spread along rays, and held-out views are the better for it."""
    cameras = forward_cameras()
    points = points_before(cameras)
    model = decide_scene_model(cameras, points, SceneModelConfig(space="ndc"))
    assert len(sparse_depths(model, cameras, seen(cameras, points))) == 0


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
