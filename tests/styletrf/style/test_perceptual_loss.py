from itertools import pairwise

import pytest
import torch
from torch import Tensor

from styletrf.style.perceptual.perceptual_loss import (
    STYLE_LAYERS,
    PerceptualLossConfig,
    gram_matrix,
    perceptual_loss,
    style_grams,
    total_variation,
)
from styletrf.style.perceptual.vgg import VGG16

EQUAL = (1.0, 1.0, 1.0, 1.0)
BOTH = pytest.mark.parametrize("relative", [True, False])


def image(seed: int, size: int = 24) -> Tensor:
    return torch.rand(1, 3, size, size, generator=torch.Generator().manual_seed(seed))


def test_gram_matrix_is_the_normalized_sum_over_the_grid():
    features = torch.rand(2, 3, 4, 5, dtype=torch.float64)
    expected = torch.einsum("bixy,bjxy->bij", features, features) / (3 * 4 * 5)
    torch.testing.assert_close(gram_matrix(features), expected)


def test_gram_matrix_is_symmetric_and_positive_semidefinite():
    gram = gram_matrix(torch.randn(1, 6, 3, 4, dtype=torch.float64))[0]
    torch.testing.assert_close(gram, gram.T)
    assert torch.linalg.eigvalsh(gram).min() > -1e-12


def test_gram_matrix_does_not_change_when_the_image_is_tiled_or_shuffled():
    features = torch.rand(1, 4, 6, 6, dtype=torch.float64)
    torch.testing.assert_close(gram_matrix(features.tile(1, 1, 2, 3)), gram_matrix(features))
    shuffled = features.flatten(2)[..., torch.randperm(36)].reshape(features.shape)
    torch.testing.assert_close(gram_matrix(shuffled), gram_matrix(features))


def test_gram_matrix_of_half_precision_neither_overflows_nor_rounds_the_sum():
    features = torch.full((1, 2, 200, 200), 100.0, dtype=torch.float16)
    gram = gram_matrix(features)
    assert gram.dtype == torch.float32
    torch.testing.assert_close(gram, torch.full((1, 2, 2), 5000.0), rtol=1e-4, atol=0)


def test_the_gradient_of_a_gram_matrix_is_that_of_finite_differences():
    features = torch.randn(1, 3, 2, 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(gram_matrix, features)


def test_total_variation_of_a_ramp_is_its_squared_slopes():
    y, x = torch.meshgrid(torch.arange(5.0), torch.arange(7.0), indexing="ij")
    ramp = (0.2 * x + 0.5 * y).expand(1, 3, 5, 7)
    torch.testing.assert_close(total_variation(ramp), torch.tensor(0.2**2 + 0.5**2))


def test_total_variation_gradient_is_zero_on_flat_images():
    flat = torch.full((1, 3, 4, 4), 0.3, requires_grad=True)
    total_variation(flat).backward()
    assert flat.grad is not None
    assert torch.equal(flat.grad, torch.zeros_like(flat))


@BOTH
def test_terms_vanish_exactly_where_they_should(vgg: VGG16, relative: bool):
    config = PerceptualLossConfig(relative=relative)
    style, content = image(1), image(2)
    grams = style_grams(vgg, style)
    same = perceptual_loss(vgg, content, content, grams, config)
    assert same.content == 0
    assert same.style > 0
    painting = perceptual_loss(vgg, style, content, grams, config)
    assert painting.style == 0
    assert painting.content > 0


@BOTH
def test_terms_are_proportional_to_their_weights(vgg: VGG16, relative: bool):
    one = PerceptualLossConfig(1.0, 1.0, EQUAL, 1.0, relative=relative)
    many = PerceptualLossConfig(2.0, 3.0, EQUAL, 5.0, relative=relative)
    arguments = vgg, image(1), image(2), style_grams(vgg, image(3))
    a, b = perceptual_loss(*arguments, one), perceptual_loss(*arguments, many)
    torch.testing.assert_close(b.total, 2 * a.content + 3 * a.style + 5 * a.tv)


def test_style_weighs_layer_by_layer(vgg: VGG16):
    arguments = vgg, image(1), image(2), style_grams(vgg, image(3))
    whole = perceptual_loss(
        *arguments, PerceptualLossConfig(style_layer_weights=(1.0, 2.0, 3.0, 4.0))
    )
    parts = [
        (k + 1)
        * perceptual_loss(*arguments, PerceptualLossConfig(style_layer_weights=tuple(unit))).style
        for k, unit in enumerate(torch.eye(4).tolist())
    ]
    torch.testing.assert_close(whole.style, torch.stack(parts).sum())


def test_relative_terms_do_not_depend_on_the_scale_of_the_network(vgg: VGG16):
    """Biases scaled with the input scale every activation alike."""
    scaled = VGG16().requires_grad_(requires_grad=False)
    scaled.load_state_dict(vgg.state_dict())
    scaled.std.div_(50)
    for name, parameter in scaled.named_parameters():
        if name.endswith("bias"):
            parameter.mul_(50)
    config = PerceptualLossConfig()
    terms, other = (
        perceptual_loss(network, image(1), image(2), style_grams(network, image(3)), config)
        for network in (vgg, scaled)
    )
    torch.testing.assert_close(other.total, terms.total, rtol=1e-3, atol=0)


@pytest.mark.extremes("Perceptual loss")
@BOTH
@pytest.mark.parametrize("value", [0.0, 0.5, 1.0])
def test_flat_images_have_finite_terms_and_gradients(vgg: VGG16, relative: bool, value: float):
    flat = torch.full((1, 3, 16, 16), value)
    output = flat.clone().requires_grad_()
    config = PerceptualLossConfig(relative=relative)
    terms = perceptual_loss(vgg, output, flat, style_grams(vgg, flat), config)
    terms.total.backward()
    assert terms.total.isfinite()
    assert output.grad is not None
    assert output.grad.isfinite().all()


@BOTH
def test_descending_the_gradient_lowers_the_loss(vgg: VGG16, relative: bool):
    config, content = PerceptualLossConfig(relative=relative), image(2)
    grams, output, losses = style_grams(vgg, image(1)), content.clone(), []
    for _ in range(4):
        output.requires_grad_()
        loss = perceptual_loss(vgg, output, content, grams, config).total
        (gradient,) = torch.autograd.grad(loss, output)
        output = (output - 0.05 * gradient / gradient.norm()).detach()
        losses.append(float(loss.detach()))
    assert all(later < earlier for earlier, later in pairwise(losses))


def test_targets_are_those_of_the_style_layers(vgg: VGG16):
    grams = style_grams(vgg, image(1))
    assert tuple(grams) == STYLE_LAYERS
    assert not any(gram.requires_grad for gram in grams.values())
