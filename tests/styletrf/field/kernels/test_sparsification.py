"""Laws of sparsified gradients: what they are on average, how many rows, and what is left alone."""

from dataclasses import replace

import pytest
import torch
from kernel_cases import generator, make_segments, whole_grid

from styletrf.field.kernels import Sparsification, sparsify_gradient
from styletrf.field.kernels.sparsification import sparsified
from styletrf.field.tensor_vm import TensorVM

OFFSETS = [k / 64 for k in range(64)]


def heavy_tailed(rows, channels, seed=0):
    values = torch.randn(rows, channels, generator=generator(seed), dtype=torch.float64)
    return values * torch.randn(rows, 1, generator=generator(seed + 1)).double() ** 5


@pytest.mark.parametrize("threshold", [0.1, 3.0, 100.0])
def test_the_mean_over_offsets_is_the_gradient(threshold):
    gradient = heavy_tailed(200, 3)
    drawn = [sparsified(gradient, Sparsification(threshold, offset)) for offset in OFFSETS]
    error = (torch.stack(drawn).mean(dim=0) - gradient).abs().sum(dim=1)
    largest_row = threshold * gradient.abs().sum(dim=1).mean()
    assert float(error.max()) <= float(largest_row) / len(OFFSETS) * (1 + 1e-9)


def test_as_many_rows_are_kept_whatever_the_offset():
    gradient = heavy_tailed(1000, 1)
    kept = [
        int((sparsified(gradient, Sparsification(3.0, u)) != 0).any(dim=1).sum()) for u in OFFSETS
    ]
    assert max(kept) - min(kept) <= 1
    assert max(kept) < 300


def test_rows_above_the_threshold_are_kept_as_they_are():
    gradient = heavy_tailed(500, 2)
    magnitude = gradient.abs().sum(dim=1)
    above = magnitude >= 2 * magnitude.mean()
    assert above.any()
    assert torch.equal(sparsified(gradient, Sparsification(2.0, 0.3))[above], gradient[above])


@pytest.mark.parametrize("sparsification", [None, Sparsification(0.0, 0.5)])
def test_without_a_threshold_nothing_is_left_out(sparsification):
    gradient = heavy_tailed(50, 2)
    assert torch.equal(sparsified(gradient, sparsification), gradient)


@pytest.mark.extremes("Optimizer and gradients")
@pytest.mark.parametrize("value", [0.0, torch.nan, torch.inf])
def test_nothing_and_what_is_not_finite_come_back_as_they_are(value):
    gradient = torch.full((4, 2), value)
    assert torch.equal(
        sparsified(gradient, Sparsification(3.0, 0.5)).isfinite(), gradient.isfinite()
    )
    one_bad = heavy_tailed(40, 2)
    one_bad[7, 1] = value
    kept = sparsified(one_bad, Sparsification(3.0, 0.5))
    assert bool(kept.isfinite().all()) == bool(one_bad.isfinite().all())


def test_a_gradient_without_rows_stays_empty():
    assert sparsified(torch.zeros(0, 3), Sparsification(3.0, 0.5)).shape == (0, 3)


@pytest.mark.parametrize("magnitude", [1e-30, 1e30])
def test_gradients_of_extreme_magnitude_keep_their_sum(magnitude):
    gradient = torch.full((64, 1), magnitude)
    total = sparsified(gradient, Sparsification(4.0, 0.5)).double().sum()
    assert float(total) == pytest.approx(64 * magnitude, rel=1e-5)


def test_values_pass_and_their_gradient_is_thinned():
    values = torch.zeros(30, 2, dtype=torch.float64, requires_grad=True)
    upstream, sparsification = heavy_tailed(30, 2), Sparsification(3.0, 0.25)
    passed = sparsify_gradient(values, sparsification)
    passed.backward(upstream)
    assert torch.equal(passed, values)
    assert torch.equal(values.grad, sparsified(upstream, sparsification))


def gradients(backend, sparsification):
    factors = TensorVM((9, 8, 7), (4, 3, 2), scale=0.5, generator=generator(0))
    march = replace(whole_grid(), sparsification=sparsification)
    samples = backend.trace(factors, make_segments(40, seed=1), torch.full((40,), 0.5), march)
    (samples.weights * torch.sin(17 * samples.s)).sum().backward()
    return [p.grad.double() for p in factors.parameters()]


def test_a_march_gives_the_factors_their_gradient_on_average(backend):
    exact = gradients(backend, None)
    drawn = [gradients(backend, Sparsification(2.0, offset)) for offset in OFFSETS[::4]]
    for k, of_factor in enumerate(exact):
        one, mean = drawn[0][k], sum(g[k] for g in drawn) / len(drawn)
        assert (mean - of_factor).norm() < 0.1 * of_factor.norm()
        assert (one - of_factor).norm() > 0.1 * of_factor.norm()
