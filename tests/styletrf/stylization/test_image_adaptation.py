"""Deferred back-propagation is back-propagation; the density is only read."""

import copy
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from unittest.mock import patch

import numpy as np
import pytest
import torch
from mini_scene import MINI_FIT as CONFIG
from mini_scene import fit, fitted_plane, painted_plane

from styletrf.capture.view_images import view_images
from styletrf.field.kernels import kernels_for
from styletrf.field.ray_cache import march_once
from styletrf.field.rendering import RenderConfig
from styletrf.field.training import trainer
from styletrf.field.training.fit_inputs import TrainingViews
from styletrf.field.training.validation_views import validation_views
from styletrf.field.view_rays import ViewRays
from styletrf.scene.free_space import CELLS
from styletrf.style.perceptual.perceptual_loss import color_drift
from styletrf.stylization.adaptation import AdaptationConfig
from styletrf.stylization.background import EmptyBackground
from styletrf.stylization.full_adaptation import finetune_all, fit_new_field
from styletrf.stylization.image_adaptation import (
    ImageAdaptationConfig,
    accumulate_gradient,
    adapt_to_image_loss,
)
from styletrf.stylization.power_choice import PowerChoiceConfig
from styletrf.stylization.strategies import Stylization, StylizationConfig, stylized
from styletrf.stylization.view_windows import as_picture
from styletrf.trajectory.frames import rendered
from tasks.presets.presets import settings_for

CPU = torch.device("cpu")
KERNELS = kernels_for(CPU)


@pytest.fixture(scope="module")
def fitted():
    return fitted_plane()


@pytest.fixture
def field(fitted):
    """A copy to change."""
    return copy.deepcopy(fitted)


@dataclass(frozen=True)
class OfPlainRender:
    """A loss of renders that compares with the plain render itself."""

    loss: Callable[..., torch.Tensor]

    def content_features(self, plain):
        return plain

    def __call__(self, image, content, generator=None):
        return self.loss(image, content, generator)


def dark_gray_and_alike(image, plain, generator=None):
    return (image.mean(dim=(2, 3)) - 0.2).square().sum() + (image - plain).abs().mean()


def rays_of(scene, field, pixels=400):
    rays = ViewRays(scene.cameras, scene.model.space, field.step_length, CPU)
    return march_once(
        field, rays, view_images(scene.images), torch.arange(pixels), KERNELS,
        min_weight=0.0, termination=0.0, cache_bytes=1 << 30,
    )  # fmt: skip


def test_tiles_give_the_gradient_of_the_whole(scene, field, monkeypatch):
    cache = rays_of(scene, field)
    monkeypatch.setattr("styletrf.stylization.image_adaptation._TILE", 150)
    target = as_picture(cache.target.reshape(20, 20, 3))
    of_picture = partial(dark_gray_and_alike, plain=target)
    accumulate_gradient(field, cache, (20, 20, 3), of_picture, KERNELS, variance_weight=2.0)
    tiled = [p.grad.clone() for p in field.appearance.parameters()]
    field.appearance.zero_grad()
    color, variance = cache.batch(0, 400).color_and_variance(field.appearance, KERNELS)
    (of_picture(as_picture(color.reshape(20, 20, 3))) + 2 * variance.mean()).backward()
    for found, parameter in zip(tiled, field.appearance.parameters(), strict=True):
        torch.testing.assert_close(found, parameter.grad, atol=1e-6, rtol=1e-3)


def test_the_loss_falls_and_the_density_stays(scene, field):
    before = {name: tensor.clone() for name, tensor in field.density.state_dict().items()}
    losses = []
    adapt_to_image_loss(
        field, scene.cameras, (scene.images, scene.images), scene.model.space,
        OfPlainRender(dark_gray_and_alike),
        ImageAdaptationConfig(iterations=18, rate=1.0), AdaptationConfig(), KERNELS,
        lambda done, total, loss: losses.append(loss),
    )  # fmt: skip
    assert sum(losses[-6:]) < 0.85 * sum(losses[:6])
    assert all(torch.equal(t, before[name]) for name, t in field.density.state_dict().items())


@torch.no_grad()
def test_the_variance_along_a_ray_is_the_mean_square_less_the_square_of_the_mean(scene, field):
    """sum_s w_s |c_s - m|^2 = sum_s w_s |c_s|^2 - |sum_s w_s c_s|^2 / opacity, opaque or not."""
    batch = rays_of(scene, field).batch(0, 400)
    halved = replace(batch.samples, weights=batch.samples.weights / 2)
    for rays in (batch, replace(batch, samples=halved, opacity=batch.opacity / 2)):
        color, variance = rays.color_and_variance(field.appearance, KERNELS)
        torch.testing.assert_close(color, rays.color(field.appearance, KERNELS))
        colors = field.appearance.decode(
            field.appearance.components(rays.samples.positions, KERNELS),
            rays.view_directions, rays.samples.ray, KERNELS,
        )  # fmt: skip
        squares = KERNELS.composite(rays.samples, colors.square().sum(dim=1, keepdim=True))[:, 0]
        total = KERNELS.composite(rays.samples, colors)
        expected = squares - total.square().sum(dim=1) / rays.opacity.clamp(min=1e-6)
        assert expected.max() > 1e-3
        torch.testing.assert_close(variance, expected.clamp(min=0), atol=1e-5, rtol=1e-3)
    one = batch.one_sample_per_ray(torch.Generator().manual_seed(0))
    assert one.color_and_variance(field.appearance, KERNELS)[1].max() < 1e-6


def test_a_loss_with_the_variance_leaves_rays_of_more_even_color(scene, field):
    def end(variance_weight):
        own = copy.deepcopy(field)
        adapt_to_image_loss(
            own, scene.cameras, (scene.images, scene.images), scene.model.space,
            OfPlainRender(dark_gray_and_alike),
            ImageAdaptationConfig(iterations=18, variance_weight=variance_weight),
            AdaptationConfig(), KERNELS,
        )  # fmt: skip
        with torch.no_grad():
            batch = rays_of(scene, own).batch(0, 400)
            return float(batch.color_and_variance(own.appearance, KERNELS)[1].mean())

    assert end(30.0) < 0.7 * end(0.0)


def test_the_content_of_a_view_that_is_seen_whole_is_looked_at_once(scene, field):
    looks = []

    class Counting(OfPlainRender):
        def content_features(self, plain):
            looks.append(plain)
            return plain

    adapt_to_image_loss(
        field, scene.cameras, (scene.images, scene.images), scene.model.space,
        Counting(dark_gray_and_alike), ImageAdaptationConfig(iterations=3 * len(scene.cameras)),
        AdaptationConfig(), KERNELS,
    )  # fmt: skip
    assert len(looks) == len(scene.cameras)


@pytest.mark.parametrize("fraction", [0.0, -0.1, 1.1])
def test_a_fit_fraction_that_is_no_fraction_is_refused(fraction):
    with pytest.raises(ValueError, match="fit_fraction"):
        StylizationConfig(fit_fraction=fraction)


def test_without_iterations_on_renders_a_style_is_that_of_the_views_alone(scene, field):
    """The fit to the views had two fifths of its iterations, and nothing followed it."""
    config = StylizationConfig(
        adaptation=AdaptationConfig(iterations=10, batch=64), appearance_scale=1.0,
        single_owner=False, weight_power=PowerChoiceConfig(powers=(1.0,)),
        image=ImageAdaptationConfig(iterations=0),
    )  # fmt: skip

    def appearance(match):
        views = scene.images, 255 - scene.images
        of_style = KERNELS, None, match
        job = Stylization(copy.deepcopy(field), scene.model, scene.cameras, [], *views, *of_style)
        return stylized(job, config)[0].appearance.state_dict()

    of_views, matched = appearance("pixels"), appearance("distributions")
    assert all(torch.equal(tensor, matched[name]) for name, tensor in of_views.items())


def test_a_loss_that_says_nothing_of_color_leaves_the_painted_colors(scene, field):
    """A loss of contrast alone would take the view to gray: the drift holds it."""

    def contrast(image, plain, generator):
        return image.var(dim=(2, 3)).sum()

    def end(color_weight):
        own = copy.deepcopy(field)
        adapt_to_image_loss(
            own, scene.cameras, (scene.images, scene.images), scene.model.space,
            OfPlainRender(contrast),
            ImageAdaptationConfig(iterations=24, rate=1.0, color_weight=color_weight),
            AdaptationConfig(), KERNELS,
        )  # fmt: skip
        renders = rendered(own, scene.model.space, scene.cameras[:1], RenderConfig(), CPU)
        shown = next(iter(renders)).color.permute(2, 0, 1)[None]
        return color_drift(shown, (scene.images[:1] / 255).permute(0, 3, 1, 2), block_px=2)

    assert end(20.0) < 0.3 * end(0.0)


def test_windows_of_large_views_bring_all_of_them_nearer(scene, field):
    def distance():
        renders = rendered(field, scene.model.space, scene.cameras, RenderConfig(), CPU)
        return [float((r.color - 0.2).square().mean()) for r in renders]

    def to_dark_gray(image, plain, generator):
        return (image - 0.2).square().mean()

    before = distance()
    adapt_to_image_loss(
        field, scene.cameras, (scene.images, scene.images), scene.model.space,
        OfPlainRender(to_dark_gray),
        ImageAdaptationConfig(iterations=60, rate=1.0, color_weight=0.0, window_px=16),
        AdaptationConfig(), KERNELS,
    )  # fmt: skip
    assert min(scene.images.shape[1:3]) > 16, "the views are larger than a window"
    assert all(now < 0.5 * then for now, then in zip(distance(), before, strict=True))


def test_a_window_is_seen_by_the_rays_of_its_own_pixels(scene, field):
    """What the loss is given as the plain render is that very part of the view."""
    seen = []

    def looking(image, plain, generator):
        seen.append(plain)
        return image.mean()

    adapt_to_image_loss(
        field, scene.cameras, (scene.images, scene.images), scene.model.space,
        OfPlainRender(looking),
        ImageAdaptationConfig(iterations=6, window_px=16), AdaptationConfig(), KERNELS,
    )  # fmt: skip
    views = (scene.images.float() / 255).permute(0, 3, 1, 2)
    for picture in seen:
        places = views.unfold(2, 16, 1).unfold(3, 16, 1)
        apart = (places - picture[0, None, :, None, None]).abs().amax(dim=(1, 4, 5))
        assert apart.min() < 1e-6


def test_the_loss_sees_an_object_on_its_mean_color_and_not_on_its_background(scene, field):
    """Where nothing is hit, the picture and the plain one have the mean color."""
    ground = EmptyBackground(np.zeros(3), np.array([0.25, 0.5, 0.75]))
    seen = []

    def looking(image, plain, generator):
        seen.append((image.detach(), plain))
        return image.mean()

    space, config = scene.model.space, ImageAdaptationConfig(iterations=1, rate=1e-9)
    for of_views in (None, ground):
        adapt_to_image_loss(
            field, scene.cameras[:1], (scene.images[:1], scene.images[:1]), space,
            OfPlainRender(looking),
            config, AdaptationConfig(), KERNELS, background=of_views,
        )  # fmt: skip
    (shown, plain), (covered, plain_covered) = seen
    torch.testing.assert_close(covered - shown, plain_covered - plain)
    rest = (covered - shown) / torch.tensor(ground.mean).float()[:, None, None]
    assert rest.min() > -1e-5
    assert rest.max() < 1 + 1e-5
    torch.testing.assert_close(rest[:, 0], rest[:, 2], atol=1e-5, rtol=1e-4)


def test_blocks_of_held_colors_fit_small_pictures():
    image = torch.rand(1, 3, 11, 7, generator=torch.Generator().manual_seed(0))
    assert color_drift(image, image, block_px=42) == 0
    edge = image.clone()
    edge[..., -1, -1] += 1  # in a block that is not whole
    assert color_drift(edge, image, block_px=5) > 0


def test_a_field_with_its_density_free_has_the_average_of_its_last_parameters(scene, field):
    last, averaged = (
        finetune_all(
            field, scene.views(), scene.model.space,
            replace(CONFIG, iterations=20, average_share=average), KERNELS,
        )[0]
        for average in (0.0, 0.5)
    )  # fmt: skip
    assert not torch.equal(last.density.factors.planes[0], averaged.density.factors.planes[0])


def test_free_strategies_reach_the_painted_views_and_leave_the_field(scene, field):
    painted = TrainingViews(scene.cameras, 255 - scene.images)
    before = {name: tensor.clone() for name, tensor in field.state_dict().items()}
    config = replace(CONFIG, iterations=240)
    adapted, curve = finetune_all(field, painted, scene.model.space, config, KERNELS)
    assert curve[-1].psnr > curve[0].psnr + 3
    assert all(torch.equal(t, before[name]) for name, t in field.state_dict().items())
    moved = [
        not torch.equal(a, b)
        for a, b in zip(adapted.density.parameters(), field.density.parameters(), strict=True)
    ]
    assert any(moved), "S2 frees the density"
    new, curve = fit_new_field(painted, scene.volume, replace(CONFIG, iterations=150), KERNELS)
    assert curve[-1].psnr > curve[0].psnr + 3
    assert new.resolution == scene.model.resolution


@pytest.mark.parametrize("strategy", ["s1", "s2"])
def test_free_strategies_have_no_validation_views(strategy):
    """Painted views disagree, so that one set aside would end the fit early."""
    many = painted_plane(20)
    config = replace(CONFIG, iterations=20, upsample_at=(0.1, 0.3), early_gain_db=1e3)
    field = fit(many, config) if strategy == "s2" else None
    with patch.object(trainer, "validation_views", wraps=trainer.validation_views) as asked:
        if field is None:
            fit_new_field(many.views(), many.volume, config, KERNELS)
        else:
            finetune_all(field, many.views(), many.model.space, config, KERNELS)
    (call,) = asked.call_args_list
    assert validation_views(*call.args[:2], config) is not None
    assert validation_views(*call.args) is None


def test_a_new_field_leaves_free_space_empty(scene):
    free = torch.zeros(CELLS, CELLS, CELLS, dtype=torch.bool)
    free[: CELLS // 2] = True
    config = replace(CONFIG, iterations=40)

    def occupied(free):
        volume = replace(scene.volume, free=free)
        new, _ = fit_new_field(scene.views(), volume, config, KERNELS)
        half = new.density.occupancy.shape[0] // 2
        return new.density.occupancy[: half - 1].any()

    assert occupied(None)
    assert not occupied(free)


def test_the_factors_of_the_controls_steer_the_loss_of_renders():
    usual = StylizationConfig()
    with_style_parameters = usual.with_style_parameters(stroke_scale=2.0, content_weight=0.5)
    assert with_style_parameters.stroke_scale == 2 * usual.stroke_scale
    assert with_style_parameters.image_loss.content_weight == 0.5 * usual.image_loss.content_weight
    assert with_style_parameters.content.level == usual.content.level / 0.5
    assert usual.with_style_parameters(1.0, 1.0) == usual


def test_the_published_preset_holds_no_content():
    assert settings_for("StylizedField", "paper")["content.rate"] == 0
