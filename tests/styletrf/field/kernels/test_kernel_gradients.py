"""The reference's gradients are those of finite differences: the others are held to it."""

import pytest
import torch
from kernel_cases import REFERENCE, doubled, generator, make_segments, packed
from torch.autograd import gradcheck

from styletrf.field.kernels import March
from styletrf.field.tensor_vm import TensorVM


class Call(torch.nn.Module):
    """Makes a function of a module one of its parameters."""

    def __init__(self, module, run):
        super().__init__()
        self.module, self.run = module, run
        self.names = [f"module.{name}" for name, _ in module.named_parameters()]

    def forward(self):
        return self.run(self.module)

    def of(self, *values):
        parameters = dict(zip(self.names, values, strict=True))
        return torch.func.functional_call(self, parameters, ())

    def inputs(self):
        return tuple(p.detach().clone().requires_grad_() for p in self.module.parameters())


def leaf(*shape, seed=0):
    return torch.randn(*shape, generator=generator(seed), dtype=torch.float64, requires_grad=True)


@pytest.fixture
def factors():
    return TensorVM((3, 4, 2), (2, 1, 1), scale=0.7, generator=generator(0)).double()


def test_gradients_of_features_are_those_of_finite_differences(factors):
    positions = 2 * torch.rand(6, 3, generator=generator(1), dtype=torch.float64) - 1
    call = Call(factors, lambda module: REFERENCE.features(module, positions))
    assert gradcheck(call.of, call.inputs())


@pytest.mark.parametrize("termination", [0.0, 0.3])
def test_gradients_of_the_weights_along_rays_are_those_of_finite_differences(factors, termination):
    segments = doubled(make_segments(4, seed=5, max_steps=6, reach=1.2))
    occupancy = torch.ones(2, 2, 2, dtype=torch.uint8)
    occupancy[0, 1, 0] = 0
    jitter = torch.rand(4, generator=generator(2)).double()
    march = March(occupancy, 0.0, 1.0, termination)
    call = Call(factors, lambda module: REFERENCE.trace(module, segments, jitter, march).weights)
    assert gradcheck(call.of, call.inputs(), atol=1e-6)


def test_gradients_of_sums_along_rays_are_those_of_finite_differences():
    weights, values = leaf(6), leaf(6, 3, seed=1)
    assert gradcheck(
        lambda w, v: REFERENCE.composite(packed([2, 0, 3, 1], w), v), (weights, values)
    )


def test_gradients_of_kept_weights_are_those_of_finite_differences():
    weights = leaf(6).detach().abs().requires_grad_()
    assert gradcheck(lambda w: REFERENCE.prune(packed([2, 0, 3, 1], w), 0.5).weights, weights)


def test_gradients_of_decoded_colors_are_those_of_finite_differences():
    ray = torch.tensor([0, 0, 1, 3, 3])
    leaves = [
        leaf(*shape, seed=k) for k, shape in enumerate([(5, 4), (4, 6), (6, 4), (3, 6), (3,)])
    ]

    def colors(components, of_view, *layers):
        return REFERENCE.decode(components, of_view, ray, *layers)

    assert gradcheck(colors, leaves)
