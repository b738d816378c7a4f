"""Mixing appearances of one density mixes their renders, exactly; a region bounds the style."""

import re

import numpy as np
import pytest
import torch
from mini_scene import fitted_plane

from styletrf.field.kernels import kernels_for
from styletrf.field.rendering import RenderConfig, render_view
from styletrf.field.view_rays import ViewRays
from styletrf.stylization.adaptation import AdaptationConfig, adapt_appearance
from styletrf.stylization.mixed_appearance import MixedAppearance
from styletrf.stylization.region import Box, Masked

CPU = torch.device("cpu")
KERNELS = kernels_for(CPU)


@pytest.fixture(scope="module")
def fields(scene):
    """A field as photographed, and the same with its colors inverted."""
    plain, inverted = fitted_plane(), fitted_plane()
    config = AdaptationConfig(iterations=150, batch=256)
    space = scene.model.space
    adapt_appearance(inverted, scene.cameras, 255 - scene.images, space, config, KERNELS)
    return plain, inverted


EXACT = RenderConfig(0.0, 0.0)


def shown(scene, field, appearance=None, config=EXACT):
    rays = ViewRays(scene.cameras, scene.model.space, field.step_length, CPU)
    return render_view(field, KERNELS, rays, 0, scene.cameras[0], config, appearance).color


@pytest.mark.parametrize("deferred", [False, True])
@pytest.mark.parametrize("fraction", [0.0, 0.3, 1.0])
def test_a_mixture_renders_the_mixture_of_the_renders(scene, fields, fraction, deferred):
    plain, _ = fields
    config = RenderConfig(0.0, 0.0, deferred=deferred)
    parts = [shown(scene, plain, f.appearance, config) for f in fields]
    mixed = MixedAppearance([f.appearance for f in fields], [1 - fraction, fraction])
    torch.testing.assert_close(
        shown(scene, plain, mixed, config), (1 - fraction) * parts[0] + fraction * parts[1],
        atol=2e-6, rtol=1e-5,
    )  # fmt: skip
    assert (parts[0] - parts[1]).abs().mean() > 0.1


def test_a_box_styles_what_is_in_it(scene, fields):
    plain, inverted = fields
    space = scene.model.space
    everything = Box((-1e6, -1e6, -1e6), (1e6, 1e6, 1e6))
    nothing = Box((1e5, 1e5, 1e5), (1e6, 1e6, 1e6))
    appearances = [f.appearance for f in fields]
    background_alike = [a.background_color() for a in appearances]
    for region, expected in ((everything, inverted), (nothing, plain)):
        mixed = MixedAppearance(appearances, [0.0, 1.0], region, space)
        render = shown(scene, plain, mixed)
        difference = (render - shown(scene, expected)).abs().max()
        assert difference < 1e-5 + (background_alike[0] - background_alike[1]).abs().max()


@pytest.fixture
def crisp(fields):
    """The inverted appearance, composited with squared weights."""
    appearance = fields[1].appearance
    appearance.weight_power = 2.0
    yield appearance
    appearance.weight_power = 1.0


@pytest.mark.parametrize("fraction", [0.0, 1.0])
def test_the_ends_of_a_mixture_have_their_own_power(scene, fields, crisp, fraction):
    plain = fields[0].appearance
    mixed = MixedAppearance([plain, crisp], [1 - fraction, fraction])
    end, other = (crisp, plain) if fraction else (plain, crisp)
    render, own, of_other = (shown(scene, fields[0], a) for a in (mixed, end, other))
    torch.testing.assert_close(render, own, atol=2e-6, rtol=1e-5)
    assert (render - of_other).abs().mean() > 0.1


def test_outside_of_a_region_the_power_is_the_photographs(scene, fields, crisp):
    plain, space = fields[0].appearance, scene.model.space
    nothing = Box((1e5, 1e5, 1e5), (1e6, 1e6, 1e6))
    render = shown(scene, fields[0], MixedAppearance([plain, crisp], [0.0, 1.0], nothing, space))
    torch.testing.assert_close(render, shown(scene, fields[0]), atol=2e-6, rtol=1e-5)


def test_appearances_of_one_power_have_it_in_and_out_of_a_region(scene, fields):
    here = Box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
    parts = [f.appearance for f in fields]
    mixed = MixedAppearance(parts, [0.3, 0.7], here, scene.model.space)
    assert mixed.weight_powers(torch.zeros(2, 3)) == 1.0


def test_a_mask_styles_what_its_view_shows_white(scene, fields):
    plain, _ = fields
    camera = scene.cameras[0]
    rays = ViewRays(scene.cameras, scene.model.space, plain.step_length, CPU)
    depth = render_view(plain, KERNELS, rays, 0, camera, RenderConfig()).depth.numpy()
    mask = np.zeros_like(depth)
    mask[:, camera.width // 2 :] = 1
    region = Masked(camera, mask, depth, thickness=0.5)
    mixed = MixedAppearance([f.appearance for f in fields], [0.0, 1.0], region, scene.model.space)
    render, without, whole = (shown(scene, plain, a) for a in (mixed, None, fields[1].appearance))
    half = camera.width // 2
    assert (render - without)[:, : half - 1].abs().mean() < 0.02
    assert (render - whole)[:, half + 1 :].abs().mean() < 0.1
    assert (render - without)[:, half + 1 :].abs().mean() > 0.1


def test_what_hides_behind_the_masked_surface_is_outside(scene):
    camera = scene.cameras[0]
    ones = np.ones((camera.height, camera.width))
    region = Masked(camera, ones, 2 * ones, thickness=0.05)
    on_axis = camera.center_world + np.outer([1.0, 2.0, 2.2, -1.0], camera.forward_world)
    np.testing.assert_array_equal(region.inside(on_axis), [1, 1, 0, 0])
    np.testing.assert_array_equal(region.inside(np.full((1, 3), np.nan)), [0])


@pytest.mark.parametrize("fractions", [[0.5], [0.5, 0.6], [-0.1, 1.1], []])
def test_invalid_fractions_are_refused(fields, fractions):
    with pytest.raises(ValueError, match=re.escape(f"{fractions}")):
        MixedAppearance([f.appearance for f in fields], fractions)


def test_an_empty_box_is_refused():
    with pytest.raises(ValueError, match=r"\(1\.0, 0\.0, 1\.0\)"):
        Box((0.0, 0.0, 0.0), (1.0, 0.0, 1.0))
