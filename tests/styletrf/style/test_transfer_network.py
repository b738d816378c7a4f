import copy
from functools import cache
from unittest.mock import patch

import pytest
import torch
from torch.func import functional_call

from styletrf.style import style_network
from styletrf.style.style_network import stylize
from styletrf.style.transfer.network import (
    StyleConditioning,
    TransferNetwork,
    TransferNetworkConfig,
    conditioned,
)
from styletrf.style.transfer.style_predictor import StylePredictor, style_embedding

TINY = TransferNetworkConfig(widths=(2, 3, 4), n_residual=1)


def tiny(seed: int = 0) -> TransferNetwork:
    return TransferNetwork(TINY, torch.Generator().manual_seed(seed))


def conditioning(seed: int = 0) -> StyleConditioning:
    torch.manual_seed(seed)
    return StyleConditioning(TINY)


def test_default_has_the_published_size():
    network = TransferNetwork(TransferNetworkConfig())
    count = {name: sum(p.numel() for p in getattr(network, f"{name}_parameters")().values())
             for name in ("style", "shared")}  # fmt: skip
    assert count == {"style": 2 * (10 * 32 + 16 + 8 + 3), "shared": 107_624}


def test_style_and_shared_parameters_are_all_and_none_is_both():
    network = tiny()
    style, shared = network.style_parameters(), network.shared_parameters()
    assert not style.keys() & shared.keys()
    assert {**style, **shared}.keys() == dict(network.named_parameters()).keys()


@pytest.mark.parametrize("value", [-1e3, 0.0, 0.5, 1e3])
def test_output_lies_in_0_to_1(value: float):
    painted = tiny()(value * torch.rand(1, 3, 17, 22))
    assert painted.min() >= 0
    assert painted.max() <= 1


def test_gradients_are_those_of_finite_differences():
    network = tiny().double()
    image = torch.rand(1, 3, 16, 16, dtype=torch.float64)
    parameters = {name: p.detach().clone() for name, p in network.named_parameters()}
    direction = {name: torch.randn_like(p) for name, p in parameters.items()}

    def loss(step: torch.Tensor) -> torch.Tensor:
        moved = {name: p + step * direction[name] for name, p in parameters.items()}
        return functional_call(network, moved, (image + step * 0.1,)).square().sum()

    step = torch.zeros((), dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(loss, (step,), eps=1e-7, atol=1e-3, rtol=1e-3)


@pytest.mark.extremes("Transfer network")
@pytest.mark.parametrize("size", [(16, 16), (17, 4096), (4096, 18), (1023, 31)])
def test_pictures_of_any_proportions_are_painted(size):
    painted = stylize(tiny(), torch.rand(*size, 3))
    assert painted.shape == (*size, 3)
    assert painted.isfinite().all()


def test_conditioning_of_mixed_embeddings_is_the_mixture_of_conditionings():
    module, a, b = conditioning(), torch.randn(100), torch.randn(100)
    mixed = module(0.3 * a + 0.7 * b)
    for name, value in mixed.items():
        torch.testing.assert_close(value, 0.3 * module(a)[name] + 0.7 * module(b)[name])


def test_conditioning_gives_every_style_parameter_its_value():
    network, module, embedding = tiny(), conditioning(), torch.randn(100)
    before = copy.deepcopy(network.state_dict())
    own = conditioned(network, module, embedding)
    for name, value in module(embedding).items():
        assert torch.equal(own.style_parameters()[name], value)
    for name, value in network.shared_parameters().items():
        assert torch.equal(own.shared_parameters()[name], value)
    assert all(torch.equal(before[name], value) for name, value in network.state_dict().items())


def test_a_conditioned_network_paints_as_the_functional_call_does():
    network, module = tiny(), conditioning()
    embedding, image = torch.randn(100, requires_grad=True), torch.rand(1, 3, 18, 21)
    painted = functional_call(network, dict(module(embedding)), (image,))
    own = conditioned(network, module, embedding)
    torch.testing.assert_close(own(image), painted)
    painted.square().sum().backward()
    for tensor in (embedding, module.affine.weight, *network.shared_parameters().values()):
        assert tensor.grad is not None
        assert tensor.grad.isfinite().all()
        assert tensor.grad.abs().max() > 0


def paintings() -> dict[str, torch.Tensor]:
    generator = torch.Generator().manual_seed(0)
    return {
        "black": torch.zeros(70, 64, 3),
        "white": torch.ones(70, 64, 3),
        "noise": torch.rand(70, 64, 3, generator=generator),
        "8000x20": torch.rand(20, 8000, 3, generator=generator),
        "1x1": torch.full((1, 1, 3), 0.5),
    }


@pytest.fixture(scope="module")
def network_for(transfer):
    """Returns the network for a painting by its name."""
    return cache(lambda name: transfer.network_for(paintings()[name]))


@pytest.mark.extremes("Transfer network")
@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
@pytest.mark.parametrize("painting", paintings())
@pytest.mark.parametrize("content", ["black", "white", "noise"])
def test_extreme_paintings_and_contents_stay_finite(network_for, painting, content, dtype):
    network = network_for(painting)
    with patch.object(style_network, "is_faster_in_bfloat16", lambda _: dtype == torch.bfloat16):
        painted = stylize(network, paintings()[content])
    assert all(parameter.isfinite().all() for parameter in network.parameters())
    assert painted.isfinite().all()


@pytest.mark.extremes("Transfer network")
@pytest.mark.parametrize("picture", ["black", "white", "noise"])
def test_bfloat16_is_within_two_levels_on_average(network_for, picture, stability):
    network, image = network_for("noise"), paintings()[picture]
    with patch.object(style_network, "is_faster_in_bfloat16", lambda _: True):
        found = stylize(network, image)
    with torch.no_grad():
        exact = copy.deepcopy(network).double()(image.double().permute(2, 0, 1)[None])[0]
    exact = exact.permute(1, 2, 0)
    assert (found - exact).abs().mean() < 2 / 255
    stability(picture, found, exact, precision="bfloat16", within=0.1)


def test_embedding_of_a_square_does_not_depend_on_its_layout(transfer):
    painting = torch.rand(256, 256, 3)
    found = style_embedding(transfer.predictor, painting)
    direct = transfer.predictor(painting.permute(2, 0, 1)[None])[0]
    torch.testing.assert_close(found, direct)
    assert found.shape == (100,)
    assert not found.requires_grad


def test_predictor_has_gradients_to_everything():
    torch.manual_seed(0)
    predictor, painting = StylePredictor(), torch.rand(1, 3, 256, 256, requires_grad=True)
    predictor(painting).square().sum().backward()
    assert painting.grad is not None
    assert all(p.grad is not None and p.grad.isfinite().all() for p in predictor.parameters())
