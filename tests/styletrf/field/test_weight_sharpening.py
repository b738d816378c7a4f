"""Sharpened weights are the weights of a thinner surface at the same place."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from kernel_cases import REFERENCE, packed

from styletrf.field.kernels import kernels_for
from styletrf.field.weight_sharpening import LARGEST_POWER, sharpened

KERNELS = kernels_for(torch.device("cpu"))
WEIGHTS = st.lists(st.floats(0, 1, width=32), min_size=1, max_size=20)


def on_one_ray(weights):
    return packed([len(weights)], torch.tensor(weights, dtype=torch.float32))


@settings(deadline=None)
@given(weights=WEIGHTS, power=st.floats(1, 4))
def test_the_opacity_of_a_ray_stays(weights, power):
    samples = on_one_ray(weights)
    thinner = sharpened(samples, power, KERNELS)
    before, after = (KERNELS.opacity(s) for s in (samples, thinner))
    torch.testing.assert_close(after, before, rtol=1e-4, atol=1e-30)
    assert (thinner.weights >= 0).all()


@settings(deadline=None)
@given(weights=WEIGHTS, power=st.floats(1, 4))
def test_the_order_of_weights_stays_and_the_heaviest_gets_no_lighter(weights, power):
    samples = on_one_ray(weights)
    order = samples.weights.argsort(stable=True)
    after = sharpened(samples, power, KERNELS).weights
    assert (after[order].diff() >= -1e-6).all()
    assert after.max() >= samples.weights.max() * (1 - 1e-4) - 1e-30


def test_the_power_one_changes_nothing():
    samples = on_one_ray([0.5, 0.2, 0.1])
    assert torch.equal(sharpened(samples, 1.0, KERNELS).weights, samples.weights)


def test_squares_share_a_rays_mass_by_the_squares():
    samples = packed([2, 0, 1], torch.tensor([0.6, 0.2, 0.3]))
    expected = torch.tensor([0.8 * 0.36 / 0.40, 0.8 * 0.04 / 0.40, 0.3])
    torch.testing.assert_close(sharpened(samples, 2.0, KERNELS).weights, expected)


def test_each_sample_may_have_a_power_of_its_own():
    samples = packed([2, 2], torch.tensor([0.6, 0.2, 0.5, 0.1]))
    powers = torch.tensor([1.0, 1.0, 3.0, 3.0])
    each = sharpened(samples, powers, KERNELS).weights
    torch.testing.assert_close(each[:2], samples.weights[:2])
    torch.testing.assert_close(each[2:], sharpened(samples, 3.0, KERNELS).weights[2:])


def test_powers_apply_one_after_another():
    samples = on_one_ray([0.5, 0.2, 0.1])
    twice = sharpened(sharpened(samples, 2.0, KERNELS), 1.5, KERNELS)
    torch.testing.assert_close(twice.weights, sharpened(samples, 3.0, KERNELS).weights)


@pytest.mark.extremes("Weights along a ray")
@pytest.mark.parametrize("weights", [[0.0, 0.0], [1e-38, 1e-38], [1e-20, 1.0]])
def test_extreme_weights_stay_finite(weights):
    after = sharpened(on_one_ray(weights), 4.0, KERNELS).weights
    assert torch.isfinite(after).all()
    assert after.sum() <= sum(weights) * 1.001


@pytest.mark.parametrize("samples", [1, 1000, 30_000])
def test_an_opaque_ray_stays_opaque_at_the_largest_power(samples):
    """Beyond, the powers of many small weights would all be 0, and the background would show."""
    after = sharpened(on_one_ray([1 / samples] * samples), LARGEST_POWER, KERNELS)
    torch.testing.assert_close(KERNELS.opacity(after), torch.ones(1), rtol=1e-3, atol=0)


def test_the_gradient_of_the_weights_is_that_of_differences():
    weights = torch.tensor([0.5, 0.2, 0.1, 0.7], dtype=torch.float64, requires_grad=True)

    def first_ray(values):
        return sharpened(packed([3, 1], values), 2.0, REFERENCE).weights

    assert torch.autograd.gradcheck(first_ray, (weights,))
