"""Distortion: the closed form of the double sum, and its extremes."""

import itertools
from dataclasses import replace

import pytest
import torch
from kernel_cases import segments_between, with_steps
from mini_scene import KERNELS, MINI_FIT, fit

from styletrf.field.kernels import Samples
from styletrf.field.training.distortion import distortion
from styletrf.field.training.trainer import FieldTrainer
from styletrf.field.view_rays import ViewRays


def packed(weights: list[list[float]], s: list[list[float]], n_steps: int = 10):
    counts = torch.tensor([0] + [len(row) for row in weights])
    ray = torch.repeat_interleave(counts[1:])
    flat = torch.tensor([w for row in weights for w in row])
    along = torch.tensor([x for row in s for x in row])
    samples = Samples(counts.cumsum(0), ray, along, torch.zeros(len(flat), 3), flat)
    vectors = torch.ones(len(weights), 3)
    return samples, with_steps(segments_between(vectors, 2 * vectors, 1), n_steps)


def test_distortion_is_the_double_sum_over_pairs():
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
def test_rays_without_samples_have_no_distortion():
    assert distortion(*packed([[], []], [[], []])) == 0


def test_the_gradient_of_distortion_is_that_of_the_double_sum():
    samples, segments = packed([[0.2, 0.3, 0.4]], [[0.1, 0.4, 0.8]])
    samples.weights.requires_grad_()
    distortion(samples, segments).backward()
    w, s = samples.weights.detach(), samples.s
    expected = 2 * (w[None] * (s[:, None] - s[None]).abs()).sum(1) + 2 * w / 30
    torch.testing.assert_close(samples.weights.grad, expected)


@torch.no_grad()
def distortion_of(field, scene):
    """The mean distortion of the rays of the first view."""
    rays = ViewRays(scene.cameras, scene.model.space, field.step_length, torch.device("cpu"))
    height, width = scene.images.shape[1:3]
    rows, columns = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    segments = rays.segments(0, torch.stack([columns, rows], dim=-1).reshape(-1, 2) + 0.5)
    jitter = torch.full((len(segments),), 0.5)
    march = field.density.march(1e-4)
    return float(
        distortion(KERNELS.trace(field.density.factors, segments, jitter, march), segments)
    )


def test_the_weights_of_a_fit_with_it_are_gathered(scene):
    short = replace(MINI_FIT, iterations=60)
    without, with_it = (fit(scene, replace(short, distortion_weight=w)) for w in (0.0, 0.1))
    assert distortion_of(with_it, scene) < 0.5 * distortion_of(without, scene)


@pytest.mark.parametrize(("given", "used"), [(None, 0.0), (0.3, 0.3), (0.0, 0.0)])
def test_the_space_decides_where_no_weight_is_given(scene, given, used):
    config = replace(MINI_FIT, distortion_weight=given)
    fit = FieldTrainer(scene.views(), scene.volume, config, KERNELS)
    assert scene.model.space.kind == "ndc"
    assert fit.config.distortion_weight == used


def test_ndc_alone_has_none_of_its_own_accord():
    ndc, box, unbounded = (MINI_FIT.in_space(kind) for kind in ("ndc", "box", "unbounded"))
    assert ndc.distortion_weight == 0
    assert box.distortion_weight == unbounded.distortion_weight
    assert box.distortion_weight > 0
