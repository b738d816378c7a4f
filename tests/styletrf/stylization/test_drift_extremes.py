"""Image adaptation: the drift of colors of pictures without light or contrast."""

import pytest
import torch

from styletrf.style.perceptual.perceptual_loss import color_drift

BLOCK_PX = 2
ADAPTATION = pytest.mark.extremes("Image adaptation")
PICTURES = {
    "black": torch.zeros(1, 3, 48, 40),
    "white": torch.ones(1, 3, 48, 40),
    "faint": 0.5 + 1e-6 * torch.rand(1, 3, 48, 40, generator=torch.Generator().manual_seed(0)),
    "noise": torch.rand(1, 3, 48, 40, generator=torch.Generator().manual_seed(1)),
}


@ADAPTATION
@pytest.mark.parametrize("painted", PICTURES)
@pytest.mark.parametrize("rendered", PICTURES)
def test_the_drift_of_colors_is_finite_with_a_finite_gradient(rendered, painted, stability):
    image = PICTURES[rendered].clone().requires_grad_()
    drift = color_drift(image, PICTURES[painted], BLOCK_PX)
    drift.backward()
    assert torch.isfinite(image.grad).all()
    assert torch.isfinite(drift)
    if painted != "black":  # whose drift is that over the smallest number of the precision
        exact = color_drift(PICTURES[rendered].double(), PICTURES[painted].double(), BLOCK_PX)
        stability(f"{rendered} for {painted}", drift, exact, absolute=True)


@ADAPTATION
@pytest.mark.parametrize("picture", PICTURES)
def test_a_picture_does_not_drift_from_itself(picture, stability):
    drift = color_drift(PICTURES[picture], PICTURES[picture], BLOCK_PX)
    stability(picture, drift, 0.0, within=0.0)
