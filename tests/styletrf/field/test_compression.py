"""A smaller field shows the same: cropping changes no color, dropping no more than is allowed."""

import copy
import math
from dataclasses import replace

import pytest
import torch
from mini_scene import MINI_FIT as CONFIG
from mini_scene import fit

from styletrf.field.compression import compress, crop_to_occupied, svd_factors
from styletrf.field.field_config import FieldConfig
from styletrf.field.kernels import kernels_for
from styletrf.field.occupancy import occupied_voxels
from styletrf.field.radiance_field import RadianceField, load_field, save_field, set_occupancy
from styletrf.field.rendering import RenderConfig, render_view
from styletrf.field.tensor_vm import TensorVM
from styletrf.field.training import field_training
from styletrf.field.view_rays import ViewRays
from styletrf.geometry.space import Bounds

CPU = torch.device("cpu")


def shown(scene, field):
    rays = ViewRays(scene.cameras, scene.model.space.within(field.bounds), field.step_length, CPU)
    config = RenderConfig(1e-4, 0.0)
    return render_view(field, kernels_for(CPU), rays, 1, scene.cameras[1], config)


def field_with_a_block(n: int = 24) -> RadianceField:
    """Something in the middle of an otherwise empty grid."""
    config = FieldConfig(density_ranks=(8, 8, 8), appearance_ranks=(8, 8, 8))
    field = RadianceField(config, (n, n, n), torch.Generator().manual_seed(0))
    factors, middle = field.density.factors, slice(8, 15)
    with torch.no_grad():
        for factor in (*factors.planes, *factors.lines):
            factor.zero_()
        for pair in range(3):
            ramp = torch.rand(7, 7, 8, generator=torch.Generator().manual_seed(pair))
            factors.planes[pair][middle, middle] = 2 * ramp
            factors.lines[pair][6:17] = 1
    field.step_length = 0.002  # else it matters where the samples lie
    kernels = kernels_for(CPU)
    occupied = occupied_voxels(field.density, kernels, field.step_length, 1e-4, settled=True)
    set_occupancy(field.density, occupied)
    return field


def test_cropping_leaves_what_is_seen_where_it_was(scene):
    field = field_with_a_block()
    before = shown(scene, field)
    crop_to_occupied(field)
    assert max(field.resolution) < 24
    after = shown(scene, field)
    assert before.opacity.max() > 0.1
    torch.testing.assert_close(after.opacity, before.opacity, atol=0.05, rtol=0)
    torch.testing.assert_close(after.color, before.color, atol=0.05, rtol=0)


@pytest.mark.parametrize("ranks", [(1, 3, 8), (5, 4, 16)])
def test_decomposed_factors_have_the_same_sums_the_most_first(ranks):
    factors = TensorVM((9, 8, 7), ranks, generator=torch.Generator().manual_seed(0))
    ordered, singular = svd_factors(factors)
    positions = 2 * torch.rand(50, 3, generator=torch.Generator().manual_seed(1)) - 1
    kernels = kernels_for(CPU)
    torch.testing.assert_close(
        kernels.density(ordered, positions), kernels.density(factors, positions)
    )
    for values, rank in zip(singular, ranks, strict=True):
        assert len(values) <= rank
        assert (values.diff() <= 0).all()


def test_components_that_others_make_up_go_and_what_is_seen_stays(scene, tmp_path):
    """Eight components in a space of three: no one of them is small."""
    field = field_with_a_block()
    mix = torch.randn(3, 8, generator=torch.Generator().manual_seed(5))
    with torch.no_grad():
        for plane in field.density.factors.planes:
            plane.copy_(plane[..., :3] @ mix.abs())
    reference = shown(scene, field).color.clone()

    def loss(candidate):
        return 1e-5 + float((shown(scene, candidate).color - reference).square().mean())

    compression = compress(field, loss, 0.5)
    assert compression.density_ranks == field.config.density_ranks == (4, 4, 4)
    assert compression.loss_after <= 1.5 * compression.loss_before
    assert compression.parameters_after < compression.parameters_before
    save_field(tmp_path, field)
    loaded = load_field(tmp_path)
    assert loaded.bounds == field.bounds != Bounds()
    torch.testing.assert_close(
        shown(scene, loaded).color, shown(scene, field).color, atol=5e-3, rtol=0
    )


def field_of_full_rank() -> RadianceField:
    """A field all of whose components can be seen."""
    field = field_with_a_block()
    with torch.no_grad():
        for factor in (*field.density.factors.planes, *field.density.factors.lines):
            factor.add_(0.3 * torch.rand(factor.shape, generator=torch.Generator().manual_seed(3)))
    field.density.occupancy = torch.ones(1, 1, 1, dtype=torch.uint8)
    return field


@pytest.fixture
def field_and_loss(scene):
    """A field of full rank, and a loss: how far a field is from showing what that one shows."""
    field = field_of_full_rank()
    reference = shown(scene, field).color.clone()

    def loss(candidate):
        return 1e-12 + float((shown(scene, candidate).color - reference).square().mean())

    return field, loss


def test_a_field_whose_loss_may_not_rise_keeps_its_components(field_and_loss):
    field, loss = field_and_loss
    assert compress(field, loss, 0.5).density_ranks == (8, 8, 8)


def test_a_field_loses_components_as_far_as_the_bound_and_no_further(field_and_loss):
    field, loss = field_and_loss
    whole = compress(copy.deepcopy(field), loss, math.inf)
    most = 0.9 * whole.loss_after / whole.loss_before
    part = compress(field, loss, most - 1)
    assert part.loss_after <= most * part.loss_before < whole.loss_after
    assert sum(whole.density_ranks) < sum(part.density_ranks) < 24


def test_a_finished_fit_is_shrunk_by_the_bound_of_its_settings(scene, monkeypatch):
    seen = []

    def spied(field, loss_of, most_rise):
        seen.append((most_rise, loss_of(field)))
        return compress(field, loss_of, most_rise)

    monkeypatch.setattr(field_training, "compress", spied)
    config = replace(CONFIG, field=FieldConfig((8, 2, 2), (4, 2, 2)), iterations=10)
    whole, small = (fit(scene, replace(config, shrink_rise=rise)) for rise in (0.0, 0.5))
    error = (shown(scene, whole).color - scene.images[1] / 255).square().mean()
    assert seen == [(0.5, pytest.approx(float(error), rel=0.5))]  # of all photographs
    assert sum(p.numel() for p in small.parameters()) < sum(p.numel() for p in whole.parameters())
