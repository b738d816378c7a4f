"""Rendering: tiles do not matter, nothing leaks, depth is where the surface is."""

import math
from dataclasses import replace

import pytest
import torch
from kernel_cases import segments_between
from mini_scene import MINI_FIT as CONFIG
from mini_scene import fit, fitted_plane

from styletrf.field.field_config import FieldConfig
from styletrf.field.kernels import Samples, kernels_for
from styletrf.field.radiance_field import Appearance, set_occupancy
from styletrf.field.rendering import (
    LEAST_OPACITY,
    RenderConfig,
    median_depth,
    render_color,
    render_view,
)
from styletrf.field.view_rays import ViewRays

CPU = torch.device("cpu")
KERNELS = kernels_for(CPU)


@pytest.fixture(scope="module")
def field():
    return fitted_plane()


def rendered(scene, field, config):
    rays = ViewRays(scene.cameras, scene.model.space, field.step_length, CPU)
    return render_view(field, KERNELS, rays, 1, scene.cameras[1], config)


def test_tiles_do_not_change_the_image(scene, field):
    whole = rendered(scene, field, RenderConfig(tile=400))
    tiled = rendered(scene, field, RenderConfig(tile=7))
    torch.testing.assert_close(tiled.color, whole.color)
    torch.testing.assert_close(tiled.depth, whole.depth)


def test_the_thresholds_of_a_render_change_colors_little(scene, field):
    exact = rendered(scene, field, RenderConfig(termination=0.0, min_weight=0.0))
    quick = rendered(scene, field, RenderConfig())
    assert (exact.color - quick.color).abs().max() < 0.05


def test_an_empty_field_shows_the_background_at_infinity(scene, field):
    empty = fit(scene, replace(CONFIG, iterations=2))
    set_occupancy(empty.density, torch.zeros(2, 2, 2, dtype=torch.uint8))
    render = rendered(scene, empty, RenderConfig())
    background = torch.sigmoid(empty.appearance.background)
    torch.testing.assert_close(render.color, background.expand_as(render.color))
    assert (render.opacity == 0).all()
    assert torch.isposinf(render.depth).all()


def test_depth_is_positive_finite_and_color_in_range(scene, field):
    render = rendered(scene, field, RenderConfig())
    assert torch.isfinite(render.depth[render.opacity >= LEAST_OPACITY]).all()
    assert (render.depth > 0).all()
    assert ((render.color >= 0) & (render.color <= 1)).all()


def test_deferred_shading_of_one_surface_is_near_shading_its_samples(scene, field):
    exact = rendered(scene, field, RenderConfig())
    deferred = rendered(scene, field, RenderConfig(deferred=True))
    assert (exact.color - deferred.color).abs().mean() < 0.01
    torch.testing.assert_close(exact.depth, deferred.depth)


def packed(*weights_of_rays):
    """Samples of rays by their weights, in the middle of equal steps from s = 0."""
    counts = torch.tensor([len(weights) for weights in weights_of_rays])
    offsets = torch.cat([counts.new_zeros(1), counts.cumsum(0)])
    s = torch.cat([(torch.arange(n) + 0.5) / n for n in counts])
    weights = torch.cat([torch.as_tensor(weights) for weights in weights_of_rays]).float()
    return Samples(offsets, torch.repeat_interleave(counts), s, torch.zeros(len(s), 3), weights)


def from_1_to_5(n_rays, n_steps):
    """Segments whose depth is 1 + 4 s."""
    segments = segments_between(torch.ones(n_rays, 3), 2 * torch.ones(n_rays, 3), n_steps)
    return replace(segments, depth_far=torch.full((n_rays, 1), 5.0))


@pytest.mark.parametrize("n_steps", [2, 7, 64])
@pytest.mark.parametrize("thickness", [0.7, 2.0, 10.0])
def test_the_median_depth_of_a_constant_density_does_not_depend_on_the_steps(n_steps, thickness):
    """The transmittance exp(-thickness s) is one half at s = log 2 / thickness."""
    edges = torch.exp(-thickness * torch.linspace(0, 1, n_steps + 1, dtype=torch.float64))
    depth = median_depth(from_1_to_5(1, n_steps), packed(edges[:-1] - edges[1:]))
    torch.testing.assert_close(
        depth, torch.tensor([1 + 4 * math.log(2) / thickness]), rtol=1e-5, atol=0
    )


def test_the_median_depth_of_a_wall_is_where_its_step_begins():
    depth = median_depth(from_1_to_5(2, 4), packed([0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0]))
    assert depth.tolist() == [3.0, 1.0]


def test_the_median_depth_lies_in_one_of_two_surfaces_and_is_infinite_where_half_the_light_passes():
    thin, dense = 0.3, 0.6
    depth = median_depth(from_1_to_5(2, 4), packed([0, thin, 0, dense], [0, thin, 0, 0]))
    assert 4 < depth[0] < 5
    assert depth[1] == torch.inf


@pytest.mark.parametrize("opacity", [1e-4, 0.05, 0.5, 0.99])
@pytest.mark.parametrize("min_weight", [0.0, 1e-2])
def test_white_fog_before_white_stays_white(opacity, min_weight):
    """However thin its samples: dropping light ones must not turn a faint ray black."""
    n = 600
    appearance = Appearance(FieldConfig().in_space("ndc"), (4, 4, 4))
    with torch.no_grad():
        appearance.shading.output.weight.zero_()
        appearance.shading.output.bias.fill_(20.0)
        appearance.background.fill_(20.0)
    ray, s = torch.zeros(n, dtype=torch.int64), torch.linspace(0, 1, n)
    weights = torch.full((n,), opacity / n)
    samples = Samples(torch.tensor([0, n]), ray, s, torch.zeros(n, 3), weights)
    segments = segments_between(torch.zeros(1, 3), torch.ones(1, 3), n)
    color = render_color(appearance, KERNELS, segments, samples, min_weight)
    torch.testing.assert_close(color, torch.ones(1, 3), atol=1e-4, rtol=0)
