"""The network that tells styles apart, as a loss."""

from dataclasses import replace

import pytest
import torch
from tiny_style_training import TINY, style

from styletrf.style.perceptual.predictor_features import (
    FeatureMoments,
    predictor_moments,
    predictor_term,
)
from styletrf.style.training.step import StyleStep
from styletrf.style.training.trainer import begin
from styletrf.style.transfer.style_predictor import PAINTING_PX, StylePredictor

STRIDES, CHANNELS = (4, 8, 16), (24, 32, 96)


def generator(seed=0):
    return torch.Generator().manual_seed(seed)


@pytest.fixture(scope="module")
def predictor():
    torch.manual_seed(0)
    network = StylePredictor().eval().requires_grad_(requires_grad=False)
    for parameter in network.parameters():  # so that nothing dies out on the way
        torch.nn.init.normal_(parameter, std=(2 / max(1, parameter[0].numel())) ** 0.5)
    return network


@pytest.fixture
def painting():
    return torch.rand(1, 3, 96, 64, generator=generator())


@pytest.mark.parametrize("size", [(96, 64), (97, 61), (16, 16)])
def test_features_have_their_strides_and_channels(predictor, size):
    found = predictor.features(torch.rand(2, 3, *size))
    assert [f.shape[1] for f in found] == list(CHANNELS)
    for features, stride in zip(found, STRIDES, strict=True):
        for side, px in zip(features.shape[2:], size, strict=True):
            assert abs(side - px / stride) <= 1


def test_features_are_those_that_the_embedding_is_made_of(predictor):
    square = torch.rand(1, 3, PAINTING_PX, PAINTING_PX)
    seen = []
    hooks = [
        predictor.blocks[k].register_forward_hook(lambda *call: seen.append(call[-1]))
        for k in (2, 5, 12)
    ]
    predictor(square)
    for hook in hooks:
        hook.remove()
    for ours, theirs in zip(predictor.features(square), seen, strict=True):
        torch.testing.assert_close(ours, theirs)


def test_the_painting_is_nearest_to_itself(predictor, painting):
    moments = predictor_moments(predictor, painting)
    own = predictor_term(predictor, moments, painting, generator())
    other = predictor_term(predictor, moments, 1 - 0.5 * painting, generator())
    assert 0 <= own < other


def test_units_of_channels_do_not_count():
    """Scaled and shifted alike in painting and picture, a channel counts as before."""
    painting, picture = (torch.randn(1, 5, 9, 7, generator=generator(k)) for k in (0, 1))
    scale = torch.tensor([1e-1, 0.5, 1.0, 7.0, 300.0])[:, None, None]
    shift = torch.linspace(-3, 3, 5)[:, None, None]
    before = FeatureMoments.of(painting).difference(picture)
    after = FeatureMoments.of(painting * scale + shift).difference(picture * scale + shift)
    torch.testing.assert_close(after, before, rtol=1e-4, atol=1e-5)


def test_the_same_corner_gives_the_same_term(predictor, painting):
    moments = predictor_moments(predictor, painting)
    image = torch.rand(1, 3, 64, 64, generator=generator(1))
    first, again, elsewhere = (
        predictor_term(predictor, moments, image, generator(seed)) for seed in (3, 3, 4)
    )
    assert torch.equal(first, again)
    assert not torch.equal(first, elsewhere)


@pytest.mark.parametrize("size", [(64, 64), (97, 61), (20, 40), (16, 16)])
def test_the_network_sees_windows_of_one_size(predictor, painting, size):
    """A GPU plans convolutions anew for each size: on an H200 a step took 3.3 s for 0.1 s."""
    moments, sizes = predictor_moments(predictor, painting), set()
    hook = predictor.stem.register_forward_pre_hook(lambda _, seen: sizes.add(seen[0].shape))
    for seed in range(8):
        predictor_term(predictor, moments, torch.rand(1, 3, *size), generator(seed))
    hook.remove()
    assert len(sizes) == 1


def test_a_step_down_the_gradient_comes_nearer(predictor, painting):
    moments = predictor_moments(predictor, painting)
    image = torch.full((1, 3, 64, 64), 0.5).requires_grad_()
    term = predictor_term(predictor, moments, image, generator())
    (gradient,) = torch.autograd.grad(term, image)
    moved = image - 1e-3 * gradient / gradient.norm()
    assert predictor_term(predictor, moments, moved, generator()) < term


@pytest.mark.extremes("Style network")
@pytest.mark.parametrize("value", [0.0, 1.0])
def test_flat_images_and_paintings_stay_finite(predictor, value):
    flat = torch.full((1, 3, 64, 64), value, requires_grad=True)
    for target in (flat.detach(), 1 - flat.detach()):
        term = predictor_term(predictor, predictor_moments(predictor, target), flat, generator())
        (gradient,) = torch.autograd.grad(term, flat)
        assert torch.isfinite(term)
        assert torch.isfinite(gradient).all()


def test_a_training_step_counts_the_predictor_by_its_weight(vgg, predictor):
    """The style term grows linearly with the weight, from what it is without a predictor."""

    def style_term(weight, network=predictor):
        config = replace(TINY, identity_iterations=0, predictor_weight=weight)
        training, config = begin(config, torch.device("cpu"))
        step = StyleStep(config, vgg, style(), predictor=network)
        content = torch.rand(1, 3, 32, 32, generator=generator())
        return float(step.terms(training.network, 0, content).style.detach())

    without, once, twice = style_term(1.0, None), style_term(1.0), style_term(2.0)
    assert once > without
    assert twice - once == pytest.approx(once - without, rel=1e-3)
