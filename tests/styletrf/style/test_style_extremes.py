"""The style stages at the ends of what they may be given: finite, or refused in words."""

from dataclasses import replace

import pytest
import torch
from expected_errors import rejects
from tiny_style_training import TINY, style

from styletrf.style.perceptual.perceptual_loss import (
    PerceptualLossConfig,
    gram_matrix,
    perceptual_loss,
    relative_difference,
    style_grams,
)
from styletrf.style.style_network import StyleNetwork, StyleNetworkConfig, stylize
from styletrf.style.training.step import StyleStep
from styletrf.style.training.temporal_loss import TemporalLossConfig
from styletrf.style.training.trainer import begin

SMALL = StyleNetworkConfig(width=2, n_residual=1)


@pytest.mark.extremes("Style network")
@pytest.mark.parametrize("size", [(16, 16), (17, 4096), (4096, 18), (16, 4095), (1023, 31)])
def test_pictures_of_any_proportions_are_painted(size):
    network = StyleNetwork(SMALL, torch.Generator().manual_seed(0))
    painted = stylize(network, torch.rand(*size, 3))
    assert painted.shape == (*size, 3)
    assert torch.isfinite(painted).all()


@pytest.mark.extremes("Gram matrices")
@pytest.mark.parametrize("value", [0.0, 1e-30, 1e-3, 1e3, 1e9])
def test_features_of_any_scale_have_finite_grams_and_gradients(value):
    features = torch.full((1, 4, 6, 6), value, requires_grad=True)
    gram = gram_matrix(features)
    loss = relative_difference(gram, torch.zeros_like(gram) + value)
    loss.backward()
    assert torch.isfinite(gram).all()
    assert torch.isfinite(loss)
    assert torch.isfinite(features.grad).all()


@pytest.mark.extremes("Style training")
@pytest.mark.parametrize("weight", [10.0**k for k in range(-6, 7, 2)])
def test_style_weights_over_twelve_orders_train_a_finite_step(vgg, weight):
    loss = PerceptualLossConfig(style_weight=weight)
    training, config = begin(
        replace(TINY, loss=loss, identity_iterations=0),
        torch.device("cpu"),
    )
    step = StyleStep(config, vgg, style())
    terms = step(training, 1, torch.rand(1, 3, 32, 32))
    assert torch.isfinite(terms.total)
    assert all(torch.isfinite(p).all() for p in training.network.parameters())


@pytest.mark.extremes("Style training")
@pytest.mark.parametrize("weight", [1e39, 1e300])
def test_a_weight_that_is_not_finite_in_float32_is_named(vgg, weight):
    loss = PerceptualLossConfig(style_weight=weight)
    config = replace(TINY, loss=loss, identity_iterations=0)
    training, config = begin(config, torch.device("cpu"))
    with rejects("style training", "style"):
        StyleStep(config, vgg, style())(training, 0, torch.rand(1, 3, 32, 32))


@pytest.mark.extremes("Style training")
def test_a_style_that_is_the_content_costs_nothing(vgg):
    image = torch.rand(1, 3, 48, 48, generator=torch.Generator().manual_seed(0))
    image.requires_grad_()
    config = PerceptualLossConfig(tv_weight=0.0)
    terms = perceptual_loss(vgg, image, image.detach(), style_grams(vgg, image.detach()), config)
    terms.total.backward()
    assert terms.total < 1e-5
    assert image.grad is not None
    assert torch.isfinite(image.grad).all()


@pytest.mark.extremes("Style training")
@pytest.mark.parametrize("level", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("painting", [0.0, 1.0])
def test_flat_content_and_a_flat_painting_train_a_finite_step(vgg, level, painting):
    config = replace(TINY, temporal_loss=TemporalLossConfig(every=1), identity_iterations=0)
    training, config = begin(config, torch.device("cpu"))
    step = StyleStep(config, vgg, torch.full((64, 64, 3), painting))
    for k in range(3):
        assert torch.isfinite(step(training, k, torch.full((1, 3, 32, 32), level)).total)


@pytest.mark.extremes("Style training")
def test_noise_that_drowns_the_photograph_is_finite(vgg):
    config = replace(TINY, temporal_loss=TemporalLossConfig(noise=1e3, shift_px=1e4, every=1))
    training, config = begin(config, torch.device("cpu"))
    terms = StyleStep(config, vgg, style())(training, 0, torch.rand(1, 3, 32, 32))
    assert torch.isfinite(terms.total)
    assert terms.temporal == 0, "nothing of it is seen twice"
