"""The style stages in bfloat16, half and single precision against the same in float64."""

import copy
from functools import cache
from unittest.mock import patch

import pytest
import torch
from torch import Tensor, nn

from styletrf.style import style_network
from styletrf.style.perceptual.perceptual_loss import (
    PerceptualLossConfig,
    gram_matrix,
    perceptual_loss,
    style_grams,
    total_variation,
)
from styletrf.style.style_network import StyleNetwork, StyleNetworkConfig, stylize

NORMALIZATION = pytest.mark.extremes("Instance normalization")
NETWORK = pytest.mark.extremes("Style network")
GRAM = pytest.mark.extremes("Gram matrices")
LOSS = pytest.mark.extremes("Perceptual loss")
PRECISIONS = pytest.mark.parametrize(
    "dtype", [torch.float32, torch.bfloat16, torch.float16], ids=["float32", "bfloat16", "float16"]
)
TRAINED_IN = pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])


def noise(*shape: int, seed: int = 0) -> Tensor:
    return torch.rand(shape, generator=torch.Generator().manual_seed(seed))


def pictures() -> dict[str, Tensor]:
    y, x = torch.meshgrid(torch.linspace(0, 1, 40), torch.linspace(0, 1, 48), indexing="ij")
    point = torch.zeros(40, 48, 3)
    point[20, 24] = 1
    return {
        "black": torch.zeros(40, 48, 3),
        "white": torch.ones(40, 48, 3),
        "one white pixel on black": point,
        "a ramp of contrast 1e-3": 0.5 + 1e-3 * torch.stack([x, y, x * y], dim=-1),
        "a ramp": torch.stack([x, y, x * y], dim=-1),
        "noise": noise(40, 48, 3),
    }


@NORMALIZATION
@TRAINED_IN
@pytest.mark.parametrize("contrast", [0.0, 1e-6, 1e-2, 1.0, 1e3])
@pytest.mark.parametrize("offset", [0.0, 1.0, 1e2])
def test_normalized_features_have_mean_0_and_variance_at_most_1(dtype, contrast, offset, stability):
    """Whatever their contrast about whatever mean; what has none becomes 0 and not noise."""
    norm = nn.InstanceNorm2d(4, affine=True)
    x = (offset + contrast * noise(1, 4, 24, 24)).to(dtype)
    with torch.autocast("cpu", torch.bfloat16, enabled=dtype == torch.bfloat16):
        found = norm(x)
    exact = copy.deepcopy(norm).double()(x.double())
    assert found.float().mean(dim=(2, 3)).abs().max() < 0.05
    assert found.float().var(dim=(2, 3), unbiased=False).max() < 1.05
    precision = str(dtype).removeprefix("torch.")
    lost = 2e-6 * offset / max(contrast, 3e-3)  # what rounding takes of x - mean, in deviations
    within = 3e-2 if dtype == torch.bfloat16 else 1e-5 + lost
    stability(f"contrast {contrast:g} about {offset:g}", found, exact,
              precision=precision, within=within, absolute=True)  # fmt: skip


@NETWORK
@TRAINED_IN
@pytest.mark.parametrize("picture", pictures())
def test_a_painted_picture_is_within_two_levels_on_average(dtype, picture, stability):
    """Of float64, in the mean of its pixels; bfloat16 is chosen here whatever the hardware."""
    image, generator = pictures()[picture], torch.Generator().manual_seed(0)
    network = StyleNetwork(StyleNetworkConfig(24, 3), generator)
    with patch.object(style_network, "is_faster_in_bfloat16", lambda _: dtype == torch.bfloat16):
        found = stylize(network, image)
    with torch.no_grad():
        exact = copy.deepcopy(network).double()(image.double().permute(2, 0, 1)[None])[0]
    exact = exact.permute(1, 2, 0).clamp(0, 1)
    assert (found - exact).abs().mean() < 2 / 255
    stability(picture, found, exact, precision=str(dtype).removeprefix("torch."))


@GRAM
@PRECISIONS
@pytest.mark.parametrize("size", [0.0, 1e-3, 1.0, 1e4])
def test_gram_matrices_keep_the_precision_of_single(dtype, size, stability):
    """Of features in any precision: products are summed in float32, divided beforehand."""
    features = (size * noise(1, 8, 64, 64)).to(dtype)
    found, exact = gram_matrix(features), gram_matrix(features.double())
    torch.testing.assert_close(found.double(), exact, rtol=1e-5, atol=0)
    stability(f"features of {size:g}", found, exact, precision=str(dtype).removeprefix("torch."))


@pytest.fixture(scope="module")
def total(vgg):
    """The loss of an image, by a network of some precision."""
    content, style = noise(1, 3, 40, 48, seed=1), noise(1, 3, 40, 48, seed=2)

    @cache
    def grams(dtype):
        network = copy.deepcopy(vgg).to(dtype)
        return network, style_grams(network, style.double() if dtype == torch.float64 else style)

    def total_of(output, dtype, *, relative):
        network, painting = grams(dtype)
        config = PerceptualLossConfig(relative=relative)
        return perceptual_loss(network, output, content.to(output.dtype), painting, config).total

    return total_of


@LOSS
@TRAINED_IN
@pytest.mark.parametrize("relative", [True, False])
@pytest.mark.parametrize("picture", pictures())
def test_terms_are_those_of_float64(total, dtype, relative, picture, stability):
    """To a hundredth of the whole in bfloat16, with a finite gradient."""
    output = pictures()[picture].permute(2, 0, 1)[None].contiguous().requires_grad_()
    found = total(output, dtype, relative=relative)
    found.backward()
    assert torch.isfinite(output.grad).all()
    exact = total(output.detach().double(), torch.float64, relative=relative)
    torch.testing.assert_close(found.double(), exact, rtol=2e-2, atol=0)
    kind = "relative" if relative else "as published"
    stability(f"{picture}, {kind}", found, exact, precision=str(dtype).removeprefix("torch."))


@LOSS
@pytest.mark.parametrize("size", [0.0, 1e-18, 1.0, 1e18])
def test_total_variation_of_any_contrast_is_that_of_float64(size, stability):
    image = (size * noise(1, 3, 20, 20)).requires_grad_()
    found = total_variation(image)
    found.backward()
    assert torch.isfinite(image.grad).all()
    stability(f"total variation, contrast {size:g}", found, total_variation(image.double()))
