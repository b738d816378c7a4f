"""Adam as the fits use it, with gradients of any size: no step is longer than its rate."""

import copy

import pytest
import torch
from kernel_cases import generator

from styletrf.field.appearance import Appearance
from styletrf.field.field_config import FieldConfig
from styletrf.field.kernels.sparsification import Sparsification, sparsified
from styletrf.field.training.optimizer import take_step
from styletrf.stylization.adaptation import AdaptationConfig, optimizer_of

pytestmark = pytest.mark.extremes("Optimizer and gradients")

SMALL = FieldConfig((2, 1, 1), (2, 1, 1), features=4, hidden=8)
BOUND = (1 - 0.9) / (1 - 0.99) ** 0.5  # of a step over its rate (Kingma and Ba 2015, section 2.1)


def stepped(size: float, *, double: bool) -> Appearance:
    """An appearance after three steps down gradients of one size and random signs."""
    appearance = Appearance(SMALL, (4, 3, 5), generator(0))
    appearance = appearance.double() if double else appearance
    optimizer = optimizer_of(appearance, AdaptationConfig())
    plane = appearance.factors.planes[0]
    for k in range(3):
        signs = torch.randn(plane.shape, generator=generator(k)).sign()
        (size * signs * plane).sum().backward()
        take_step(optimizer, 1.0)
    return appearance


@pytest.mark.parametrize("size", [0.0, 1e-30, 1e-20, 1e-8, 1.0, 1e15, 1e18, 1e30])
def test_a_step_is_no_longer_than_its_rate_allows(size, stability):
    """A gradient whose square overflows moves nothing, one whose square is lost hardly anything."""
    before = Appearance(SMALL, (4, 3, 5), generator(0)).factors.planes[0]
    found, exact = (stepped(size, double=d).factors.planes[0] for d in (False, True))
    assert torch.isfinite(found).all()
    longest = 3 * BOUND * AdaptationConfig().factor_rate
    assert (found - before).abs().max() <= longest * (1 + 1e-5)
    if size < 1e30:  # the square of a larger one is infinite in float32 alone
        stability(f"gradients of {size:g}", found, exact)
    else:
        torch.testing.assert_close(found, before)


@pytest.mark.parametrize("decay", [1e-30, 1.0])
def test_a_rate_of_any_size_is_taken(decay, stability):
    appearances = [Appearance(SMALL, (4, 3, 5), generator(0)) for _ in range(2)]
    appearances[1] = copy.deepcopy(appearances[0]).double()
    for appearance in appearances:
        optimizer = optimizer_of(appearance, AdaptationConfig())
        appearance.background.sum().backward()
        take_step(optimizer, decay)
    found, exact = (a.background for a in appearances)
    assert (found <= 0).all()
    stability(f"rate times {decay:g}", found, exact)


@pytest.mark.parametrize("size", [0.0, 1e-38, 1e-20, 1.0, 1e20, 1e37])
def test_thinned_gradients_keep_their_sum_whatever_their_size(size, stability):
    """All rows alike: as many are kept as make up for those left out."""
    gradient = torch.full((64, 2), size)
    found = sparsified(gradient, Sparsification(4.0, 0.5)).double().sum()
    assert float(found) == pytest.approx(128 * float(gradient[0, 0]), rel=1e-6)
    stability(f"sparsified rows of {size:g}", found, gradient.double().sum(), precision="float32")
