"""Nearest features: none away from themselves, whatever their length; finite at zero."""

import pytest
import torch

from styletrf.perceptual_loss import PerceptualLossConfig
from styletrf.stroke_losses import nearest_distance, stroke_loss


def test_the_nearest_counts_and_not_the_length():
    style = torch.eye(4, dtype=torch.float64)
    near = nearest_distance(torch.tensor([[3.0, 0, 0, 0], [0, 0, 0.5, 0]]).double(), style)
    torch.testing.assert_close(near, torch.zeros((), dtype=torch.float64), atol=1e-4, rtol=0)
    between = nearest_distance(torch.tensor([[1.0, 1, 0, 0]]).double(), style)
    assert between == pytest.approx(1 - 0.5**0.5, abs=1e-4)
    opposite = nearest_distance(-torch.ones(1, 1).double(), torch.ones(1, 1).double())
    assert opposite == pytest.approx(2, abs=1e-4)


@pytest.mark.extremes("Stroke losses")
def test_features_of_zero_have_finite_gradients():
    features = torch.zeros(3, 4, requires_grad=True)
    nearest_distance(features, torch.eye(4)).backward()
    assert features.grad is not None
    assert torch.isfinite(features.grad).all()


def test_the_distance_has_the_gradient_it_should():
    style = torch.rand(5, 4, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    features = torch.rand(3, 4, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    assert torch.autograd.gradcheck(lambda f: nearest_distance(f, style), features.requires_grad_())


@pytest.mark.parametrize("kind", ["gram", "features"])
def test_the_painting_itself_is_nearest_to_the_style(vgg, kind):
    generator = torch.Generator().manual_seed(0)
    style, other = (torch.rand(48, 48, 3, generator=generator) for _ in range(2))
    other = torch.nn.functional.avg_pool2d(other.permute(2, 0, 1)[None], 9, 1, 4)
    loss = stroke_loss(
        kind, vgg, style, 48, PerceptualLossConfig(content_weight=0.0, tv_weight=0.0)
    )
    image = style.permute(2, 0, 1)[None]
    assert loss(image, other) < 1e-3
    assert loss(image, other) < loss(other, other)


@pytest.mark.extremes("Stroke losses")
@pytest.mark.parametrize("kind", ["gram", "features"])
@pytest.mark.parametrize("image", [0.0, 0.5, 1.0])
def test_constant_images_have_finite_losses(vgg, kind, image):
    flat = torch.full((1, 3, 32, 40), image, requires_grad=True)
    loss = stroke_loss(kind, vgg, torch.full((32, 32, 3), 1 - image), 32, PerceptualLossConfig())
    value = loss(flat, torch.zeros(1, 3, 32, 40))
    value.backward()
    assert torch.isfinite(value)
    assert flat.grad is not None
    assert torch.isfinite(flat.grad).all()
