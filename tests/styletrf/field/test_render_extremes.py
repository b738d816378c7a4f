"""Rendering at the extremes, with every backend: finite, in range, light conserved."""

import copy
from dataclasses import replace

import numpy as np
import pytest
import torch
from kernel_cases import REFERENCE, doubled, generator, segments_between
from mini_scene import MINI_FIT as CONFIG
from mini_scene import painted_plane

from styletrf.field.field_config import FieldConfig
from styletrf.field.kernels import kernels_for
from styletrf.field.occupancy import occupied_voxels
from styletrf.field.radiance_field import RadianceField, set_occupancy
from styletrf.field.rendering import (
    LEAST_OPACITY,
    RenderConfig,
    render_color,
    render_rays,
    render_view,
)
from styletrf.field.training.field_training import train_field
from styletrf.field.training.fit_inputs import TrainingViews
from styletrf.field.view_rays import ViewRays
from styletrf.geometry.cameras import Camera
from styletrf.geometry.space import Space

pytestmark = pytest.mark.extremes("Rendering: color, opacity, depth")

CPU = torch.device("cpu")
SIZE = FieldConfig((2, 1, 1), (2, 1, 1), features=4, hidden=8, density_shift=0.0)
EXACT = RenderConfig(termination=0.0, min_weight=0.0)
STRAIGHT = np.column_stack([np.eye(3), [0.0, 0.0, -3.0]])  # looks along z at the box


def small_field(resolution=(4, 3, 5), **config) -> RadianceField:
    return RadianceField(replace(SIZE, **config), resolution, generator(0))


def box_space(scale: float = 1.0) -> Space:
    to_grid = np.diag([1 / scale, 1 / scale, 1 / scale, 1.0])
    return Space("box", to_grid[None], (scale, scale, scale), 1e-3 * scale)


def camera_at(center, pose=STRAIGHT) -> Camera:
    pose = np.column_stack([pose[:, :3], center])
    return Camera("a", 3, 2, 2.0, 2.0, 1.5, 1.0, pose)


def rays_of(camera, space, step):
    pixels = torch.tensor([[x + 0.5, y + 0.5] for y in range(2) for x in range(3)])
    view_rays = ViewRays([camera], space, step, torch.get_default_device())
    return view_rays.segments(torch.zeros(6, dtype=torch.int64), pixels)


def assert_sound(render):
    """Finite, in range, and infinitely far just where nothing is hit."""
    assert ((render.color >= 0) & (render.color <= 1)).all()
    assert ((render.opacity >= 0) & (render.opacity <= 1)).all()
    hit = render.opacity >= LEAST_OPACITY
    assert torch.isfinite(render.depth[hit]).all()
    assert (render.depth[hit] > 0).all()
    assert torch.isposinf(render.depth[~hit]).all()


def exactly(field, segments, config=EXACT):
    """The render by the definition, in float64."""
    return render_rays(copy.deepcopy(field).double(), REFERENCE, doubled(segments), config)


def assert_background(field, render):
    background = torch.sigmoid(field.appearance.background).detach()
    torch.testing.assert_close(render.color, background.expand_as(render.color))
    torch.testing.assert_close(render.opacity, torch.zeros_like(render.opacity))


@pytest.mark.parametrize("config", [RenderConfig(), EXACT])
@pytest.mark.parametrize("scale", [0.0, 1e-30, 1e-3, 1.0, 1e30, float("inf")])
def test_any_density_renders_and_has_finite_gradients(backend, scale, config, stability):
    field = small_field(density_scale=scale)
    segments = rays_of(camera_at([0.1, 0.2, -3.0]), box_space(), 0.4)
    render, exact = render_rays(field, backend, segments, config), exactly(field, segments, config)
    assert_sound(render)
    stability(f"color, density times {scale:g}", render.color, exact.color)
    stability(f"depth, density times {scale:g}", render.depth, exact.depth)
    march = field.density.march(config.termination)
    jitter = torch.full_like(segments.lengths, 0.5)
    samples = backend.trace(field.density.factors, segments, jitter, march)
    color = render_color(field.appearance, backend, segments, samples, config.min_weight)
    color.square().sum().backward()
    grads = [p.grad for p in field.parameters() if p.grad is not None]
    assert all(torch.isfinite(g).all() for g in grads)
    assert len(grads) > 6


@pytest.mark.parametrize("raw", [-1e30, -100.0, 100.0, 1e30])
def test_features_of_any_size_render(backend, raw, stability):
    """Hazard 12: large positive and negative features."""
    field = small_field()
    with torch.no_grad():
        for part in (field.density, field.appearance):
            part.factors.planes[0].fill_(raw)
            part.factors.lines[0].fill_(1.0)
    segments = rays_of(camera_at([0, 0, -3.0]), box_space(), 0.4)
    render = render_rays(field, backend, segments, EXACT)
    assert_sound(render)
    stability(f"features {raw:g}", render.color, exactly(field, segments).color)


@pytest.mark.parametrize(
    ("center", "hits"),
    [
        ([0.0, 0.0, -3.0], True),  # outside, before it
        ([0.0, 0.0, 3.0], False),  # behind the camera
        ([50.0, 0.0, -3.0], False),  # beside it
        ([0.1, 0.2, 0.3], True),  # inside
        ([0.0, 0.0, 0.0], True),  # at its center: rays along axes
        ([0.0, 0.0, -1.0], True),  # on its face
        ([1.0, 1.0, -1.0], True),  # on its corner
        ([0.0, 0.0, -1.0 - 1e-3], True),  # the box begins on the near plane
        ([0.0, 0.0, 1.0 - 1e-3], False),  # and ends there
    ],
)
def test_cameras_inside_on_faces_and_on_the_near_plane_see_what_is_ahead(backend, center, hits):
    field = small_field(density_scale=20.0)
    camera = replace(camera_at(center), cx=0.5, cy=0.5)  # the first pixel looks along z
    segments = rays_of(camera, box_space(), 0.3)
    render = render_rays(field, backend, segments, RenderConfig())
    assert_sound(render)
    if hits:
        assert render.opacity.max() > 0.5
    else:
        assert_background(field, render)


def test_rays_along_faces_see_what_lies_on_them(backend):
    """Two faces of the box, by rays that run within them."""
    field = small_field(density_scale=20.0)
    starts = torch.tensor([[1.0, -1.0, 0.0], [-1.0, 1.0, 1.0]])
    segments = segments_between(starts, -starts * torch.tensor([[-1, 1, 1], [1, -1, -1]]), 8)
    assert_sound(render_rays(field, backend, segments, RenderConfig()))


def test_an_empty_occupancy_grid_shows_the_background(backend):
    field = small_field()
    set_occupancy(field.density, torch.zeros(2, 2, 2, dtype=torch.uint8))
    segments = rays_of(camera_at([0, 0, -3.0]), box_space(), 0.3)
    assert_background(field, render_rays(field, backend, segments, RenderConfig()))


def test_a_field_without_density_is_looked_for_everywhere(backend):
    """An empty grid would never let it recover."""
    field = small_field(density_shift=-30.0)
    occupancy = occupied_voxels(field.density, backend, 0.1, 0.01)
    assert (occupancy == 1).all()


def test_the_clear_part_of_a_half_transparent_ray_has_the_depth_of_its_end(backend, stability):
    """Its clear part counts at the far end: the mean of the sample's depth and far."""
    field = small_field()
    with torch.no_grad():
        field.density.factors.planes[0].zero_()
        field.density.factors.planes[1].zero_()
        field.density.factors.planes[2].zero_()
    field.density.scale = 1.0
    occupancy = torch.zeros(1, 1, 8, dtype=torch.uint8)
    occupancy[0, 0, 2] = 1
    set_occupancy(field.density, occupancy)
    start = torch.tensor([[0.0, 0.0, -1.0]])
    segments = segments_between(start, -start, 8)
    segments = replace(segments, lengths=torch.full((1,), 8.0))  # softplus(0) = log 2 a step
    render = render_rays(field, backend, segments, EXACT)
    stability("opacity", render.opacity, 0.5)
    stability("depth", render.depth, 1 + (2.5 / 8 + 1) / 2)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_the_picture_does_not_depend_on_the_unit_of_length(backend, scale, stability):
    field = small_field(density_scale=5.0)
    center = np.array([0.2, -0.1, -3.0])
    at_one = rays_of(camera_at(center), box_space(), 0.3)
    scaled = rays_of(camera_at(scale * center), box_space(scale), 0.3 * scale)
    hit = at_one.n_steps > 0
    assert torch.equal(scaled.n_steps, at_one.n_steps)
    torch.testing.assert_close(scaled.lengths[hit], at_one.lengths[hit] * scale)
    scaled = replace(scaled, lengths=scaled.lengths / scale)  # density per unit of grid length
    one, other = (render_rays(field, backend, rays, EXACT) for rays in (at_one, scaled))
    torch.testing.assert_close(other.color, one.color)
    torch.testing.assert_close(other.depth, one.depth * scale)
    stability(f"unit {scale:g}", other.color, exactly(field, scaled).color)


@pytest.mark.parametrize("resolution", [(1, 4, 3), (4, 1, 3), (4, 3, 1), (1, 1, 1)])
def test_fields_with_axes_of_one_voxel_render_within_range(backend, resolution):
    field = small_field(resolution, density_scale=5.0)
    occupancy = occupied_voxels(field.density, backend, 0.3, 1e-3)
    set_occupancy(field.density, occupancy)
    segments = rays_of(camera_at([0, 0, -3.0]), box_space(), 0.3)
    assert_sound(render_rays(field, backend, segments, RenderConfig()))


@pytest.mark.parametrize("part", ["density", "appearance"])
def test_nan_in_a_plane_reaches_the_color_and_only_there(backend, part):
    """Half of the planes is NaN: so are the rays through it, and no others."""
    field = small_field((5, 3, 3), density_scale=5.0)
    with torch.no_grad():
        getattr(field, part).factors.planes[0][:, 3:] = torch.nan  # x >= 0.5
    x = torch.tensor([-0.9, -0.5, 0.6, 0.9])
    starts = torch.stack([x, torch.zeros(4), -torch.ones(4)], dim=1)
    segments = segments_between(starts, starts * torch.tensor([1.0, 1.0, -1.0]), 12)
    render = render_rays(field, backend, segments, RenderConfig())
    assert render.color.isnan().all(dim=1).tolist() == [False, False, True, True]
    assert render.color.isnan().any(dim=1).tolist() == [False, False, True, True]


@pytest.mark.parametrize("level", [0, 255])
def test_one_view_of_a_white_or_a_black_scene_can_be_fitted(level, stability):
    """Hazard 11: nothing to learn a shape from, and nothing turns NaN; the level is found."""
    scene, kernels = painted_plane(), kernels_for(CPU)
    cameras = scene.cameras[:1]
    views = TrainingViews(cameras, torch.full_like(scene.images[:1], level))
    field, _ = train_field(views, scene.volume, replace(CONFIG, iterations=60), kernels)
    assert all(torch.isfinite(p).all() for p in field.parameters())
    rays = ViewRays(cameras, scene.model.space, field.step_length, CPU)
    render = render_view(field, kernels, rays, 0, cameras[0], RenderConfig())
    level_found = render.color.mean()
    stability(f"a photograph of level {level}", level_found, level / 255, within=0.1, absolute=True)
