"""Compression of factors of any size."""

import pytest
import torch

from styletrf.field.compression import svd_factors
from styletrf.field.tensor_vm import TensorVM

COMPRESSION = pytest.mark.extremes("Compression")


def sums(factors: TensorVM) -> torch.Tensor:
    """Returns the sum of all components at every lattice point of each axis pair, in float64."""
    products = [
        torch.einsum("uvc,wc->uvw", plane.double(), line.double()).flatten()
        for plane, line in zip(factors.planes, factors.lines, strict=True)
    ]
    return torch.cat(products).detach()


@COMPRESSION
@pytest.mark.parametrize("size", [0.0, 1e-18, 1e-6, 1.0, 1e6, 1e18])
def test_decomposed_factors_of_any_size_keep_their_sums(size, stability):
    factors = TensorVM((7, 6, 5), (8, 4, 3))
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for factor in (*factors.planes, *factors.lines):
            factor.copy_(size * torch.randn(factor.shape, generator=generator))
    ordered, singular = svd_factors(factors)
    assert all((values[:-1] >= values[1:]).all() for values in singular)
    stability(f"factors of {size:g}", sums(ordered), sums(factors), precision="float32")


@COMPRESSION
def test_factors_of_one_component_said_twice_have_one_singular_value(stability):
    factors = TensorVM((7, 6, 5), (2, 2, 2))
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for factor in (*factors.planes, *factors.lines):
            factor.copy_(
                torch.randn((*factor.shape[:-1], 1), generator=generator).expand_as(factor)
            )
    ordered, singular = svd_factors(factors)
    for values in singular:
        stability("the second over the first", values[1] / values[0], 0.0, precision="float64")
    stability("the sums", sums(ordered), sums(factors), precision="float32")
