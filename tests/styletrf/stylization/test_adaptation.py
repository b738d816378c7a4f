"""The cache holds what a ray needs; the density is only read."""

import copy
from dataclasses import replace

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from mini_scene import MINI_FIT as CONFIG
from mini_scene import fit, fitted_plane

from styletrf.capture.view_images import view_images
from styletrf.field.kernels import kernels_for
from styletrf.field.ray_cache import RayCache, march_once
from styletrf.field.rendering import RenderConfig, render_rays
from styletrf.field.view_rays import ViewRays
from styletrf.stylization.adaptation import PARTS, AdaptationConfig, adapt_appearance

CPU = torch.device("cpu")
KERNELS = kernels_for(CPU)
ADAPTATION = AdaptationConfig(iterations=60, batch=256)


@pytest.mark.parametrize("name", ["iterations", "batch", "tv_every"])
def test_counts_of_an_adaptation_below_one_are_refused(name):
    """A batch of no rays was divided by."""
    with pytest.raises(ValueError, match=name):
        replace(ADAPTATION, **{name: 0})


@pytest.fixture(scope="module")
def fitted():
    return fitted_plane()


@pytest.fixture
def field(fitted):
    """A copy to change."""
    return copy.deepcopy(fitted)


def test_the_cache_renders_what_the_field_renders(scene, field):
    rays = ViewRays(scene.cameras, scene.model.space, field.step_length, CPU)
    draw = torch.randperm(len(scene.cameras) * 20 * 20)[:300]
    cache = march_once(
        field,
        rays,
        view_images(scene.images),
        draw,
        KERNELS,
        min_weight=0.0,
        termination=0.0,
        cache_bytes=1 << 30,
    )
    color = torch.cat([tile.color(field.appearance, KERNELS) for tile in cache.tiles(128)])
    torch.testing.assert_close(color, cache.batch(0, 300).color(field.appearance, KERNELS))

    view, row, column = draw // 400, draw % 400 // 20, draw % 20
    pixels = torch.stack([column, row], dim=-1).double() + 0.5
    exact = render_rays(field, KERNELS, rays.segments(view, pixels), RenderConfig(0.0, 0.0))
    torch.testing.assert_close(color, exact.color, atol=1e-5, rtol=0)
    torch.testing.assert_close(cache.target, scene.images[view, row, column].float() / 255)


def test_adapting_to_recolored_views_recolors_and_keeps_the_density(scene, field):
    before = {name: tensor.clone() for name, tensor in field.density.state_dict().items()}
    painted = 255 - scene.images
    config = replace(ADAPTATION, iterations=150)
    curve, dropped = adapt_appearance(
        field, scene.cameras, painted, scene.model.space, config, KERNELS
    )
    assert curve[-1].psnr > curve[0].psnr + 5
    assert curve[-1].psnr > 18
    assert 0 <= dropped < 0.1
    for name, tensor in field.density.state_dict().items():
        assert torch.equal(tensor, before[name]), name
    assert all(p.grad is None for p in field.density.parameters())


def test_the_same_seed_gives_the_same_appearance(scene):
    results = []
    for _ in range(2):
        field = fit(scene, replace(CONFIG, iterations=20))
        before = copy.deepcopy(field.appearance.state_dict())
        adapt_appearance(
            field, scene.cameras, scene.images, scene.model.space,
            replace(ADAPTATION, iterations=5), KERNELS,
        )  # fmt: skip
        results.append(field.appearance.state_dict())
    assert any(not torch.equal(before[name], results[1][name]) for name in before)
    assert all(torch.equal(results[0][name], results[1][name]) for name in results[0])


def test_the_cache_is_bounded_and_gone_through_again(scene, field):
    rays = ViewRays(scene.cameras, scene.model.space, field.step_length, CPU)
    pixels = torch.arange(scene.images[..., 0].numel()).repeat(30)
    cache = march_once(
        field,
        rays,
        view_images(scene.images),
        pixels,
        KERNELS,
        min_weight=2e-3,
        termination=1e-3,
        cache_bytes=1,
    )
    n = len(cache.opacity)
    assert n < len(pixels), "what exceeds the cache is not marched"
    batches = -(-n // 256)
    for k in (0, batches - 1):
        first, second = cache.batch(k, 256), cache.batch(k + batches, 256)
        assert torch.equal(first.samples.positions, second.samples.positions)
    assert len(cache.batch(0, 10 * n).opacity) == n, "fewer rays than a batch"


@given(st.integers(1, 300), st.integers(1, 100))
def test_batches_of_a_pass_have_every_ray_once_and_are_equally_large(rays, size):
    number = torch.arange(rays, dtype=torch.float32)
    nothing = torch.zeros(0, 3), torch.zeros(0), number[:, None].expand(-1, 3)
    offsets = torch.zeros(rays + 1, dtype=torch.int64)
    cache = RayCache(offsets, *nothing, opacity=number, target=torch.zeros(rays, 3), dropped=0.0)
    a_pass = -(-rays // size)
    batches = [cache.batch(k, size).opacity for k in range(a_pass)]
    assert torch.equal(torch.cat(batches), number)
    lengths = {len(batch) for batch in batches}
    assert max(lengths) <= size
    assert max(lengths) - min(lengths) <= 1
    assert torch.equal(cache.batch(a_pass, size).opacity, batches[0])


@pytest.mark.parametrize("sees_view", [True, False])
def test_without_the_view_colors_are_the_same_from_everywhere(scene, field, sees_view):
    config = replace(ADAPTATION, sees_view=sees_view, iterations=40)
    adapt_appearance(field, scene.cameras, scene.images, scene.model.space, config, KERNELS)
    components = torch.randn(5, sum(field.appearance.factors.ranks))
    ray, directions = torch.arange(5), torch.eye(3)[[0, 1, 2, 0, 1]]
    with torch.no_grad():
        from_here, from_there = (
            field.appearance.decode(components, d, ray, KERNELS) for d in (directions, -directions)
        )
    assert torch.equal(from_here, from_there) == (not sees_view)


@pytest.mark.parametrize("first", [("factors",), PARTS])
def test_an_appearance_may_be_adapted_twice(scene, field, first):
    """Weights of the view that were not fitted before could not be held."""
    for parts in (first, PARTS):
        config = replace(ADAPTATION, parts=parts, iterations=2)
        adapt_appearance(field, scene.cameras, scene.images, scene.model.space, config, KERNELS)
    shading = field.appearance.shading
    assert not shading.hidden.weight[:, shading.basis.out_features :].any()


@pytest.mark.parametrize("parts", [("factors",), ("basis", "network"), ("background",)])
def test_parts_that_are_not_named_stay(scene, field, parts):
    before = {name: value.clone() for name, value in field.appearance.state_dict().items()}
    config = replace(ADAPTATION, parts=parts, iterations=5, sees_view=True)
    adapt_appearance(field, scene.cameras, 255 - scene.images, scene.model.space, config, KERNELS)
    moved = {n for n, v in field.appearance.state_dict().items() if not torch.equal(v, before[n])}
    part_of = {"factors": "factors", "shading.basis": "basis", "shading": "network"}
    named = {next((p for k, p in part_of.items() if n.startswith(k)), "background") for n in moved}
    assert named == set(parts)


def test_unknown_parts_are_refused():
    with pytest.raises(ValueError, match="roof"):
        AdaptationConfig(parts=("factors", "roof"))


@pytest.fixture
def batch(scene, field):
    rays = ViewRays(scene.cameras, scene.model.space, field.step_length, CPU)
    cache = march_once(
        field, rays, view_images(255 - scene.images), torch.arange(400), KERNELS,
        min_weight=0.0, termination=1e-3, cache_bytes=1 << 30,
    )  # fmt: skip
    return cache.batch(0, 400)


def test_a_sample_a_ray_has_the_rays_opacity_and_is_one_of_its_samples(field, batch):
    one = batch.one_sample_per_ray(torch.Generator().manual_seed(0))
    has_samples = batch.samples.offsets.diff() > 0
    assert torch.equal(one.samples.offsets.diff(), has_samples.long())
    assert torch.equal(one.samples.weights, batch.opacity[has_samples])
    for ray, position in zip(one.samples.ray[::20], one.samples.positions[::20], strict=True):
        of_ray = batch.samples.positions[batch.samples.ray == ray]
        assert (of_ray == position).all(dim=1).any()


@torch.no_grad()
def drawn(batch, look, times):
    """What a look at the batch sees of one sample a ray, drawn so many times."""
    generator = torch.Generator().manual_seed(0)
    return torch.stack([look(batch.one_sample_per_ray(generator)) for _ in range(times)])


def test_drawn_samples_have_the_colors_of_their_rays_in_the_mean(field, batch):
    """E c_s = sum w_s c_s / sum w_s, so that the drawn color is an unbiased one of the ray."""

    def color(rays):
        return rays.color(field.appearance, KERNELS)

    colors = drawn(batch, color, 400)
    standard_error = colors.std(dim=0) / len(colors) ** 0.5
    exact = color(batch).detach()
    assert ((colors.mean(dim=0) - exact).abs() <= 5 * standard_error + 0.01).all()


def test_drawn_samples_err_at_least_as_much_as_their_rays(field, batch):
    """Jensen: of an opaque ray, |sum w c - C|^2 <= sum w |c - C|^2 for weights that sum to 1."""

    def error(rays):
        return rays.error(field.appearance, KERNELS)

    fractions = batch.samples.weights / batch.opacity[batch.samples.ray]
    opaque = replace(
        batch,
        samples=replace(batch.samples, weights=fractions),
        opacity=torch.ones_like(batch.opacity),
    )
    assert float(error(opaque).detach()) <= float(drawn(opaque, error, 50).mean()) + 1e-4


@pytest.mark.parametrize("to", ["samples", "rays"])
def test_either_loss_fits_the_field_to_painted_views(scene, field, to):
    config = replace(ADAPTATION, iterations=100, fitted=to)
    painted = 255 - scene.images
    curve, _ = adapt_appearance(field, scene.cameras, painted, scene.model.space, config, KERNELS)
    assert curve[-1].psnr > curve[0].psnr + 3
