"""Cameras, spaces and exact flow: lenses, distances and units of any size."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from styletrf.field.view_rays import ViewRays
from styletrf.geometry.cameras import (
    Camera,
    in_view,
    moved,
    pixel_centers,
    points_at_depth,
    project,
)
from styletrf.geometry.exact_flow import exact_flow
from styletrf.geometry.space import Space
from styletrf.scene.contraction import contraction
from styletrf.trajectory.trajectories import look_at

CAMERAS = pytest.mark.extremes("Cameras: lenses, projection, similarities")
SPACES = pytest.mark.extremes("Spaces: box, NDC, contraction")
FLOW = pytest.mark.extremes("Exact flow")
DOWN = np.array([0.0, 1.0, 0.0])
STRAIGHT = np.column_stack([np.eye(3), np.zeros(3)])


def camera(focal_px: float = 20.0, pose: np.ndarray = STRAIGHT) -> Camera:
    return Camera("a", 8, 6, focal_px, focal_px, 4.0, 3.0, pose)


def ndc(far: float = 1e4) -> Space:
    """The frustum of one unit across at depth 1, from there to `far`."""
    depth = [(far + 1) / (far - 1), -2 * far / (far - 1)]
    matrix = np.array([[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, *depth], [0, 0, 1, 0]])
    return Space("ndc", matrix[None], (1.0, 1.0, 1.0), 0.0)


def box() -> Space:
    return Space("box", np.eye(4)[None], (1.0, 1.0, 1.0), 1e-3)


def unbounded(reach: float = 1e4) -> Space:
    return Space("unbounded", contraction(reach), (1.0, 1.0, 1.0), 1e-6)


@CAMERAS
@pytest.mark.parametrize("focal_px", [1e-6, 1e-3, 1.0, 1e4, 1e8])
@pytest.mark.parametrize("depth", [1e-12, 1.0, 1e12])
def test_a_point_on_a_pixels_ray_projects_to_the_pixel(focal_px, depth, stability):
    pose = look_at(np.array([0.3, -0.2, 0.1]), np.array([1.0, 2.0, 3.0]), DOWN)
    pose[:, 3] *= depth  # a center far from the points' own size would round them away
    pixels = pixel_centers(8, 6)
    points = points_at_depth(camera(focal_px, pose), pixels, np.full(len(pixels), depth))
    projected, z = project(camera(focal_px, pose), points)
    np.testing.assert_allclose(projected, pixels, atol=1e-6)
    np.testing.assert_allclose(z, depth, rtol=1e-6)
    bound = max(1e-11, 1e-15 * max(focal_px, 1 / focal_px))
    case = f"focal length {focal_px:g} px, depth 1e-12 to 1e12"
    stability(case, projected, pixels, within=bound)


@CAMERAS
def test_the_center_and_its_plane_are_out_of_view_and_not_nan():
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [1e-300, 0.0, 0.0]])
    pixels, _, inside = in_view(camera(), points)
    assert not inside.any()
    assert not np.isnan(pixels).any()


@CAMERAS
@pytest.mark.parametrize("scale", [1e-50, 1e-6, 1e6, 1e50])
def test_a_similarity_of_any_scale_leaves_axes_orthonormal(scale, stability):
    rotation = look_at(np.zeros(3), np.array([1.0, 2.0, 3.0]), DOWN)[:, :3]
    similarity = np.eye(4)
    similarity[:3, :3] = scale * rotation
    axes = moved(camera(), similarity).world_from_camera[:, :3]
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    stability(f"scale {scale:g}", axes.T @ axes, np.eye(3))


def points_along(segments, s: float) -> torch.Tensor:
    rays = torch.arange(len(segments))
    return segments.positions_at(rays, torch.full((len(rays),), s, dtype=segments.origins.dtype))


@SPACES
@pytest.mark.parametrize(("space", "center"), [(ndc(), 0.0), (box(), -3.0), (unbounded(), 0.0)])
@pytest.mark.parametrize("focal_px", [2.0, 20.0, 1e6])
def test_points_of_a_segment_are_seen_at_their_pixel(space, center, focal_px, stability):
    """From half of a ray on: before it a single may be as far off as the near plane is close."""
    view = camera(focal_px, np.column_stack([np.eye(3), [0.0, 0.0, center]]))
    pixels = torch.from_numpy(pixel_centers(8, 6))
    segments = ViewRays([view], space, 0.1, torch.device("cpu")).segments(0, pixels)
    hit = segments.n_steps > 0
    assert hit.any()
    for s in (0.5, 0.75):
        grid = points_along(segments, s).double().numpy()[hit]
        assert (np.abs(grid) <= 1 + 1e-5).all()
        world = space.to_world(grid)
        known = np.isfinite(world).all(axis=1)  # not in the gaps between parts, by rounding
        projected = project(view, world[known])[0]
        case = f"{space.kind}, focal length {focal_px:g} px, in focal lengths"
        found, exact = projected / focal_px, pixels.numpy()[hit][known] / focal_px
        stability(case, found, exact, precision="float32", absolute=True)


@SPACES
@pytest.mark.parametrize("space", [ndc(1e4), ndc(1e8)], ids=["1e4", "1e8"])
def test_the_end_of_a_ray_in_ndc_is_at_the_far_plane(space, stability):
    pixels = torch.from_numpy(pixel_centers(8, 6))
    segments = ViewRays([camera()], space, 0.1, torch.device("cpu")).segments(0, pixels)
    rays, far = torch.arange(len(pixels)), segments.depth_far[:, 0]
    found = segments.depth_along(rays, torch.ones(len(rays)))
    torch.testing.assert_close(found, far, rtol=1e-5, atol=0)
    stability(f"far at {float(far.max()):.0e}", found, far)


@SPACES
@pytest.mark.parametrize("reach", [1.001, 10.0, 1e6, 1e12])
def test_contracted_points_come_back_from_anywhere(reach, stability):
    """On an axis, on a face and at the end of the grid; float64 has 16 digits for 12 decades."""
    space = unbounded(reach)
    rng = np.random.default_rng(0)
    directions = rng.uniform(-1, 1, (100, 3))
    directions /= np.abs(directions).max(axis=1, keepdims=True)
    distances = np.concatenate([[1e-12, 1e-3, 1.0], np.geomspace(1, reach, 97)])
    world = distances[:, None] * directions
    grid = space.to_grid(world)
    assert (np.abs(grid) <= 1 + 1e-9).all()
    back = space.to_world(grid)
    unit = np.maximum(1, distances)[:, None]
    bound = 1e-15 * max(reach, 10) * 10
    stability(f"up to {reach:g} boxes away", back / unit, world / unit, within=bound, absolute=True)


@SPACES
@pytest.mark.parametrize("distance", [1e3, 1e6, 1e9])
def test_a_box_seen_from_far_away_is_still_hit_where_it_is(distance, stability):
    view = camera(4 * distance, np.column_stack([np.eye(3), [0.0, 0.0, -distance]]))
    pixels = torch.tensor([[4.0, 3.0], [6.0, 3.0], [4.0, 6.0]]).double()
    segments = ViewRays([view], box(), 0.1, torch.device("cpu")).segments(0, pixels)
    assert (segments.n_steps > 0).all()
    middle = points_along(segments, 0.5)
    expected = np.column_stack([(pixels - torch.tensor([4.0, 3.0])).numpy() / 4, np.zeros(3)])
    np.testing.assert_allclose(middle.numpy(), expected, atol=1e-6)
    stability(f"{distance:g} boxes away", middle, expected)


@FLOW
@pytest.mark.parametrize("depth", [1e-6, 1.0, 1e6, 1e12, float("inf")])
@pytest.mark.parametrize("step", [0.0, 0.1])
def test_the_flow_of_a_plane_is_its_parallax(depth, step, stability):
    """focal length times step over depth, to the left; none of the sky."""
    a, b = camera(), replace(camera(), world_from_camera=np.column_stack([np.eye(3), [step, 0, 0]]))
    plane = np.full((6, 8), depth, dtype=np.float32)
    flow, valid = exact_flow(a, plane, b, plane)
    exact = np.zeros((6, 8, 2))
    exact[..., 0] = -20.0 * step / plane.astype(np.float64)
    np.testing.assert_allclose(flow, exact, rtol=1e-9, atol=1e-9)
    assert valid[3, 4] == (np.abs(exact[3, 4, 0]) <= 4)
    stability(f"plane at {depth:g}, px", flow, exact, absolute=True)
