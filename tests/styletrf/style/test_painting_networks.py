"""What Johnson's network and that of style transfer have in common."""

from collections.abc import Callable
from typing import Any

import pytest
import torch

from styletrf.style.style_network import PaintingNetwork, StyleNetwork, StyleNetworkConfig
from styletrf.style.transfer.network import TransferNetwork, TransferNetworkConfig


def johnson(seed: int = 0) -> StyleNetwork:
    config = StyleNetworkConfig(width=4, n_residual=1)
    return StyleNetwork(config, torch.Generator().manual_seed(seed))


def transfer_network(seed: int = 0) -> TransferNetwork:
    config = TransferNetworkConfig(widths=(2, 3, 4), n_residual=1)
    return TransferNetwork(config, torch.Generator().manual_seed(seed))


@pytest.fixture(params=[johnson, transfer_network])
def tiny(request: pytest.FixtureRequest) -> Any:
    """Makes a small network of either architecture from a seed."""
    return request.param


@pytest.mark.parametrize("height", [16, 17, 18, 19, 23, 64])
@pytest.mark.parametrize("width", [16, 21, 22, 40])
def test_output_has_the_size_of_the_input(
    tiny: Callable[..., PaintingNetwork], height: int, width: int
):
    assert tiny()(torch.rand(1, 3, height, width)).shape == (1, 3, height, width)


@pytest.mark.parametrize("shape", [(15, 40), (40, 15), (1, 1)])
def test_images_under_16_pixels_are_refused(
    tiny: Callable[..., PaintingNetwork], shape: tuple[int, int]
):
    with pytest.raises(ValueError, match=f"{shape[1]}x{shape[0]}"):
        tiny()(torch.rand(1, 3, *shape))


@pytest.mark.extremes("Style network")
@pytest.mark.parametrize("value", [0.0, 0.5, 1.0])
def test_constant_images_have_finite_outputs_and_gradients(
    tiny: Callable[..., PaintingNetwork], value: float
):
    network, images = tiny(), torch.full((1, 3, 20, 20), value, requires_grad=True)
    output = network(images)
    output.square().sum().backward()
    gradients = [parameter.grad for parameter in network.parameters()] + [images.grad]
    assert output.isfinite().all()
    assert all(gradient is not None and gradient.isfinite().all() for gradient in gradients)


def test_images_of_a_batch_do_not_see_each_other(tiny: Callable[..., PaintingNetwork]):
    network, images = tiny(), torch.rand(3, 3, 24, 24)
    alone = torch.cat([network(image[None]) for image in images])
    torch.testing.assert_close(network(images), alone, rtol=1e-4, atol=1e-5)


def test_networks_of_one_seed_paint_the_same(tiny: Callable[..., PaintingNetwork]):
    a, b, other = tiny(3), tiny(3), tiny(4)
    image = torch.rand(1, 3, 16, 16)
    assert torch.equal(a(image), b(image))
    assert not torch.equal(a(image), other(image))
