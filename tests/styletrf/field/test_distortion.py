"""Distortion: the closed form of the double sum, and its extremes."""

import itertools

import pytest
import torch
from kernel_cases import segments_between, with_steps

from styletrf.field.kernels import Samples
from styletrf.field.training.distortion import distortion


def packed(weights: list[list[float]], s: list[list[float]], n_steps: int = 10):
    counts = torch.tensor([0] + [len(row) for row in weights])
    ray = torch.repeat_interleave(counts[1:])
    flat = torch.tensor([w for row in weights for w in row])
    along = torch.tensor([x for row in s for x in row])
    samples = Samples(counts.cumsum(0), ray, along, torch.zeros(len(flat), 3), flat)
    vectors = torch.ones(len(weights), 3)
    return samples, with_steps(segments_between(vectors, 2 * vectors, 1), n_steps)


def test_it_is_the_double_sum_over_pairs():
    generator = torch.Generator().manual_seed(0)
    s = [sorted(torch.rand(n, generator=generator).tolist()) for n in (7, 0, 4)]
    w = [torch.rand(len(row), generator=generator).tolist() for row in s]
    expected = sum(
        ws[i] * ws[j] * (abs(row[i] - row[j]) + (i == j) / 30)
        for ws, row in zip(w, s, strict=True)
        for i, j in itertools.product(range(len(ws)), repeat=2)
    )  # fmt: skip
    assert float(distortion(*packed(w, s))) == pytest.approx(expected / 3, rel=1e-6)


def test_gathered_weights_have_less_than_spread_ones():
    near = distortion(*packed([[0.5, 0.5]], [[0.50, 0.51]]))
    apart = distortion(*packed([[0.5, 0.5]], [[0.1, 0.9]]))
    assert near < apart


@pytest.mark.extremes("Distortion")
def test_rays_without_samples_have_none():
    assert distortion(*packed([[], []], [[], []])) == 0


def test_its_gradient_is_that_of_the_double_sum():
    samples, segments = packed([[0.2, 0.3, 0.4]], [[0.1, 0.4, 0.8]])
    samples.weights.requires_grad_()
    distortion(samples, segments).backward()
    w, s = samples.weights.detach(), samples.s
    expected = 2 * (w[None] * (s[:, None] - s[None]).abs()).sum(1) + 2 * w / 30
    torch.testing.assert_close(samples.weights.grad, expected)
