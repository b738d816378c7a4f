"""Every backend of the kernels, values and gradients, against the float64 reference."""

import numpy as np
import pytest
import torch
from kernel_cases import (
    REFERENCE,
    bent_segments,
    doubled,
    generator,
    make_segments,
    packed,
    segments_between,
)

from styletrf.field.kernels import March
from styletrf.field.tensor_vm import TensorVM

SHAPES = [
    # resolution, ranks; some axes one or two wide, ranks that are no powers of two
    ((9, 7, 5), (4, 3, 2)),
    ((1, 1, 1), (1, 1, 1)),
    ((2, 1, 6), (5, 1, 12)),
    ((33, 20, 2), (24, 12, 12)),
]


def factors_of(resolution, ranks, dtype, seed=3):
    return TensorVM(resolution, ranks, scale=0.8, generator=generator(seed)).to(dtype)


def gradients(*modules):
    return [p.grad for module in modules for p in module.parameters()]


def assert_equal(ours, exact, rtol=1e-4, atol=1e-5):
    for mine, theirs in zip(ours, exact, strict=True):
        assert mine.dtype == torch.float32
        torch.testing.assert_close(mine.double(), theirs, rtol=rtol, atol=atol)


def both(backend, compute):
    """What `compute` returns for the backend in float32 and for the reference in float64."""
    return compute(backend, torch.float32), compute(REFERENCE, torch.float64)


@pytest.mark.parametrize(("resolution", "ranks"), SHAPES)
@pytest.mark.parametrize("n_rays", [0, 1, 8])
@pytest.mark.parametrize("rays_of", [make_segments, bent_segments])
def test_a_marched_color_and_its_gradients(backend, resolution, ranks, n_rays, rays_of):
    """Rays with few, many and no steps, partly outside the grid, through empty and full voxels."""
    segments = rays_of(n_rays, seed=2, reach=1.3)
    g = generator(1)
    jitter = torch.rand(n_rays, generator=g)
    occupancy = (torch.rand(5, 4, 6, generator=g) > 0.3).to(torch.uint8)
    march = March(occupancy, -1.0, 5.0, 1e-3)

    def compute(kernels, dtype):
        density, appearance = (factors_of(resolution, ranks, dtype, seed) for seed in (3, 4))
        rays = doubled(segments) if dtype == torch.float64 else segments
        samples = kernels.trace(density, rays, jitter.to(dtype), march)
        values = kernels.features(appearance, samples.positions)
        color = kernels.composite(samples, values)
        (color.sin().sum() + samples.weights.square().sum()).backward()
        results = [samples.s, samples.positions, samples.weights.detach(), color.detach()]
        return samples, results, gradients(density, appearance)

    (ours, our_values, our_gradients), (samples, values, exact) = both(backend, compute)
    assert torch.equal(ours.offsets, samples.offsets)
    assert torch.equal(ours.ray, samples.ray)
    assert_equal(our_values, values)
    assert_equal(our_gradients, exact, rtol=1e-3, atol=1e-4)


def coordinates(n, seed):
    """Inside, outside, on the border, and exactly on lattice points of 2, 3, 5 and 9 points."""
    g = generator(seed)
    lattice = torch.randint(-8, 9, (n, 3), generator=g) / 8
    inside = 2 * torch.rand(n, 3, generator=g) - 1
    return torch.cat([inside, 3 * inside, inside.sign(), lattice, 1e6 * inside])


@pytest.mark.parametrize(("resolution", "ranks"), [*SHAPES, ((9, 5, 3), (3, 1, 8))])
@pytest.mark.parametrize("n", [0, 1, 13])
def test_features_and_their_gradients_are_those_of_the_reference(backend, resolution, ranks, n):
    positions = coordinates(n, seed=0)
    upstream = torch.randn(5 * n, sum(ranks), generator=generator(7))

    def compute(kernels, dtype):
        factors = factors_of(resolution, ranks, dtype)
        values = kernels.features(factors, positions.to(dtype))
        values.backward(upstream.to(dtype))
        return [values.detach(), *gradients(factors)]

    assert_equal(*both(backend, compute), atol=1e-4)


@pytest.mark.parametrize(("resolution", "ranks"), SHAPES)
@pytest.mark.parametrize("n", [0, 1, 13])
def test_density_is_that_of_the_reference(backend, resolution, ranks, n):
    positions = coordinates(n, seed=5)

    def compute(kernels, dtype):
        return [kernels.density(factors_of(resolution, ranks, dtype), positions.to(dtype)).detach()]

    assert_equal(*both(backend, compute), atol=1e-4)


@pytest.mark.parametrize("channels", [1, 3, 5, 12, 24])
@pytest.mark.parametrize("counts", [[], [0], [1], [3, 0, 70, 1]])
def test_composites_and_their_gradients_are_those_of_the_reference(backend, channels, counts):
    n, g = sum(counts), generator(channels)
    weights, values = torch.rand(n, generator=g), torch.randn(n, channels, generator=g)
    upstream = torch.randn(len(counts), channels, generator=g)

    def compute(kernels, dtype):
        leaves = [tensor.detach().to(dtype).requires_grad_() for tensor in (weights, values)]
        sums = kernels.composite(packed(counts, leaves[0]), leaves[1])
        sums.backward(upstream.to(dtype))
        return [sums.detach(), *(leaf.grad for leaf in leaves)]

    assert_equal(*both(backend, compute))


@pytest.mark.parametrize(
    ("n", "inputs", "hidden"), [(0, 5, 8), (1, 1, 1), (7, 6, 3), (60, 48, 64), (61, 24, 20)]
)
def test_decoded_colors_and_their_gradients_are_those_of_the_reference(backend, n, inputs, hidden):
    g = generator(n)
    ray = torch.randint(0, 40, (n,), generator=g).sort().values
    upstream = torch.randn(n, 3, generator=g)
    shapes = [(n, inputs), (40, hidden), (hidden, inputs), (3, hidden), (3,)]
    values = [torch.randn(shape, generator=g) for shape in shapes]

    def compute(kernels, dtype):
        leaves = [value.detach().to(dtype).requires_grad_() for value in values]
        colors = kernels.decode(*leaves[:2], ray, *leaves[2:])
        colors.backward(upstream.to(dtype))
        return [colors.detach(), *(leaf.grad for leaf in leaves)]

    assert_equal(*both(backend, compute), rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("threshold", [0.0, 1 / 64, 3 / 64, 0.5, 2.0])
def test_heavy_samples_with_ties_and_faint_rays(backend, threshold):
    """Weights are multiples of 1/64, so that many are equal and their sums are exact."""
    g = generator(0)
    counts = [0, 1, 2, *torch.randint(0, 50, (12,), generator=g).tolist(), 0]
    weights = torch.randint(0, 4, (sum(counts),), generator=g) / 64
    weights.requires_grad_()
    heavy = backend.prune(packed(counts, weights), threshold)
    exact = REFERENCE.prune(packed(counts, weights.detach().double()), threshold)
    assert torch.equal(heavy.offsets, exact.offsets)
    assert torch.equal(heavy.ray, exact.ray)
    assert torch.equal(heavy.s.double(), exact.s)
    heavy.weights.sum().backward()
    kept = torch.zeros_like(weights).index_fill(0, heavy.s.long(), 1.0)
    assert torch.equal(weights.grad, kept)


@pytest.mark.parametrize("jitter", [0.0, 0.5])
def test_samples_exactly_on_lattice_points_and_faces_of_voxels(backend, jitter):
    """All coordinates are multiples of 1/64: no rounding may put a sample into another voxel."""
    corners = torch.tensor(list(np.ndindex(3, 3, 3)), dtype=torch.float32) - 1
    ends = -corners.roll(1, 0)
    segments = segments_between(corners, ends, 16)
    occupancy = (torch.rand(4, 2, 8, generator=generator(2)) > 0.5).to(torch.uint8)
    march = March(occupancy, 0.0, 1.0, 0.0)
    jitters = torch.full((27,), jitter)

    def compute(kernels, dtype):
        factors = factors_of((9, 5, 3), (3, 1, 2), dtype)
        rays = doubled(segments) if dtype == torch.float64 else segments
        return kernels.trace(factors, rays, jitters.to(dtype), march)

    ours, exact = both(backend, compute)
    assert torch.equal(ours.offsets, exact.offsets)
    assert torch.equal(ours.positions.double(), exact.positions)
    torch.testing.assert_close(ours.weights.double(), exact.weights, rtol=1e-4, atol=1e-6)
