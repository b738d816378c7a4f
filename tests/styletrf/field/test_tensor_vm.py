"""Resampling, total variation and L1 of the factors."""

import pytest
import torch

from styletrf.field.kernels import reference
from styletrf.field.tensor_vm import TensorVM


def test_upsampling_from_n_to_2n_minus_1_keeps_the_lattice():
    factors = TensorVM((4, 3, 5), (2, 2, 2), generator=torch.Generator().manual_seed(0))
    finer = factors.upsampled((7, 5, 9))
    assert finer.resolution == (7, 5, 9)
    for coarse, fine in zip(factors.planes, finer.planes, strict=True):
        torch.testing.assert_close(fine[::2, ::2], coarse)
    positions = torch.rand(100, 3) * 2 - 1
    lattice = torch.round((positions + 1) / 2 * torch.tensor([3, 2, 4])) / torch.tensor([3, 2, 4])
    at = 2 * lattice - 1
    torch.testing.assert_close(reference.density(finer, at), reference.density(factors, at))


@pytest.mark.extremes("TensoRF factors: interpolation, upsampling, regularizers")
def test_total_variation_of_a_constant_is_zero_with_finite_gradient():
    factors = TensorVM((4, 4, 4), (2, 2, 2))
    with torch.no_grad():
        for plane in factors.planes:
            plane.fill_(3.0)
    variation = factors.total_variation()
    variation.backward()
    assert variation == 0
    assert all(torch.isfinite(p.grad).all() for p in factors.planes)


def test_total_variation_of_a_ramp_is_its_squared_slope():
    factors = TensorVM((5, 5, 5), (1, 1, 1))
    with torch.no_grad():
        for plane in factors.planes:
            plane.copy_(0.5 * torch.arange(5.0)[None, :, None].expand(5, 5, 1))
    torch.testing.assert_close(factors.total_variation(), torch.tensor(3 * 0.25))


@pytest.mark.extremes("TensoRF factors: interpolation, upsampling, regularizers")
def test_one_voxel_axes_have_no_neighbors_and_no_nan():
    factors = TensorVM((1, 1, 1), (2, 2, 2))
    factors.total_variation().backward()
    assert factors.total_variation() == 0
    assert factors.l1() > 0


@pytest.mark.parametrize(
    ("resolution", "scale"),
    [((4, 3, 1), 1.0), ((700, 120, 2), 1e5)],  # the second's plane is taken in two blocks
)
def test_gradients_added_in_place_are_those_of_the_backward_pass(resolution, scale):
    factors = TensorVM(resolution, (2, 3, 1), generator=torch.Generator().manual_seed(1))
    (0.3 * scale * factors.total_variation() + 0.2 * scale * factors.l1()).backward()
    expected = [p.grad.clone() for p in factors.parameters()]
    for parameter in factors.parameters():
        parameter.grad.zero_()
    factors.add_total_variation_gradient(0.3 * scale)
    factors.add_l1_gradient(0.2 * scale)
    for parameter, grad in zip(factors.parameters(), expected, strict=True):
        torch.testing.assert_close(parameter.grad, grad)
