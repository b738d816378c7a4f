"""Segments agree with projecting points, whatever the space."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from captures import forward_cameras, orbit_cameras, points_before

from styletrf.field.view_rays import ViewRays
from styletrf.geometry.cameras import Camera, project
from styletrf.geometry.space import Space
from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model


@pytest.mark.extremes("Spaces: box, NDC, contraction")
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(("cameras_of", "kind"), [(forward_cameras, "ndc"), (orbit_cameras, "box")])
def test_the_space_is_decided_at_any_scale(cameras_of, kind, scale, stability):
    cameras = cameras_of(scale=scale)
    points = points_before(cameras_of(), scale)
    model = decide_scene_model(cameras, points, SceneModelConfig())
    assert model.space.kind == kind
    reference = decide_scene_model(cameras_of(), points_before(cameras_of()), SceneModelConfig())
    assert model.resolution == reference.resolution
    stability(f"focus in {kind}, world of scale {scale:g}", model.focus, reference.focus)


@pytest.mark.parametrize(
    ("cameras_of", "space"),
    [(forward_cameras, "ndc"), (orbit_cameras, "box"), (orbit_cameras, "unbounded"),
     (forward_cameras, "unbounded")],
)  # fmt: skip
@pytest.mark.parametrize("far", [1.0, 30.0])
def test_a_point_lies_on_the_ray_of_its_pixel_at_its_depth(cameras_of, space, far):
    """Also where it is drawn in from `far` away."""
    cameras = cameras_of()
    points = points_before(cameras)
    points[::3] *= 1 if space == "box" else far
    model = decide_scene_model(cameras, points, SceneModelConfig(space=space))
    views = model.normalized(cameras)
    normalized = points @ model.normalized_from_world[:3, :3].T + model.normalized_from_world[:3, 3]
    rays = ViewRays(views, model.space, 0.01, torch.device("cpu"))
    checked = 0
    for k, view in enumerate(views):
        pixels, depth = project(view, normalized)
        grid = model.space.to_grid(normalized)
        inside = (np.abs(grid) < 0.99).all(axis=1) & (depth > max(0.1, model.space.depth_min))
        segments = rays.segments(torch.full((len(pixels),), k), torch.from_numpy(pixels))
        origin, direction = segments.origins.numpy(), segments.directions.numpy()
        ends = segments.ends.numpy()
        starts = np.column_stack([0 * ends[:, 0], ends[:, :-1]])
        s = ((grid[:, None] - origin) * direction).sum(-1) / (direction**2).sum(-1)
        s = np.clip(s, starts, ends)
        away = np.linalg.norm(origin + s[..., None] * direction - grid[:, None], axis=-1)
        nearest = away.argmin(axis=1)
        np.testing.assert_allclose(away.min(axis=1)[inside], 0, atol=3e-4)
        s = np.take_along_axis(s, nearest[:, None], axis=1)[:, 0]
        found = segments.depth_along(torch.arange(len(s)), torch.from_numpy(s).float()).numpy()
        np.testing.assert_allclose(found[inside], depth[inside], rtol=2e-3)
        checked += inside.sum()
    assert checked > 100


def box_space() -> Space:
    return Space("box", np.eye(4)[None], (1.0, 1.0, 1.0), 1e-3)


@pytest.mark.extremes("Spaces: box, NDC, contraction")
def test_rays_that_miss_run_along_faces_or_start_inside(stability):
    looking = Camera("a", 3, 3, 1.0, 1.0, 1.5, 1.5, np.column_stack([np.eye(3), [0, 0, -3.0]]))
    away = replace(
        looking,
        world_from_camera=np.column_stack([np.diag([1.0, -1.0, -1.0]), [0, 0, -3.0]]),
    )
    inside = replace(looking, world_from_camera=np.column_stack([np.eye(3), [0, 0, 0.0]]))
    on_face = replace(looking, world_from_camera=np.column_stack([np.eye(3), [1.0, 0, -3.0]]))
    rays = ViewRays([looking, away, inside, on_face], box_space(), 0.1, torch.device("cpu"))
    center = torch.tensor([[1.5, 1.5]]).expand(4, 2)
    segments = rays.segments(torch.arange(4), center)
    assert segments.n_steps.tolist()[:3] == [20, 0, 10]
    assert segments.n_steps[3] == 20  # the face belongs to the grid
    for name in segments.__slots__:
        assert torch.isfinite(getattr(segments, name).float()).all(), name
    stability("lengths", segments.lengths[[0, 2]], [2.0, 0.999])
    stability("nearest depth", segments.depth_near[0], 2.0)
