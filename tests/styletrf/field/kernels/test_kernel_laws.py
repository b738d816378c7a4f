"""Closed forms and invariances, of every backend of the kernels."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from kernel_cases import (
    chains,
    constant_factors,
    generator,
    make_segments,
    packed,
    segments_between,
    whole_grid,
    with_steps,
)

from styletrf.field.kernels import March
from styletrf.field.tensor_vm import LINE_AXES, PLANE_AXES, TensorVM


def rays_along_x(n_rays, n_steps):
    """Rays from face to face, side by side in y."""
    y = torch.linspace(-0.9, 0.9, n_rays)
    origins = torch.stack([-torch.ones(n_rays), y, 0.3 * torch.ones(n_rays)], dim=1)
    return segments_between(origins, origins * torch.tensor([-1.0, 1.0, 1.0]), n_steps)


def test_features_are_the_trilinear_interpolation_of_the_dense_tensor(backend):
    """The axes of plane and line are disjoint, so the product of interpolations is exact."""
    factors = TensorVM((4, 5, 6), (2, 2, 2), generator=generator(4))
    dense = torch.zeros(4, 5, 6)
    for (u, v), w, plane, line in zip(
        PLANE_AXES, LINE_AXES, factors.planes, factors.lines, strict=True
    ):
        for index in np.ndindex(4, 5, 6):
            dense[index] += (plane[index[v], index[u]] * line[index[w]]).sum().detach()
    positions = 2 * torch.rand(50, 3, generator=generator(5)) - 1
    volume = dense.permute(2, 1, 0)[None, None]  # grid_sample wants depth (z), height, width
    expected = torch.nn.functional.grid_sample(
        volume, positions[None, None, None], align_corners=True, mode="bilinear"
    ).reshape(-1)
    torch.testing.assert_close(backend.density(factors, positions).detach(), expected)
    torch.testing.assert_close(backend.features(factors, positions).sum(dim=1).detach(), expected)


def test_constant_density_follows_beer_lambert(backend):
    """Opacity is 1 - exp(-density x length), however many the steps and wherever in them."""
    segments = with_steps(make_segments(6, seed=3), 17)
    jitter = torch.rand(6, generator=generator(0))
    samples = backend.trace(constant_factors(3.0), segments, jitter, whole_grid(0.1))
    density = 0.1 * torch.nn.functional.softplus(torch.tensor(3.0))
    expected = 1 - torch.exp(-density * segments.lengths)
    torch.testing.assert_close(backend.opacity(samples).detach(), expected)


def test_splitting_a_segment_changes_nothing(backend):
    """The transmittance of the whole is the product of its halves'."""
    factors = TensorVM((5, 4, 3), (2, 1, 1), scale=0.8, generator=generator(0))
    whole = with_steps(make_segments(5, seed=1), 16)
    start, end = whole.origins[:, 0], (whole.origins + whole.directions)[:, 0]
    middle = (start + end) / 2
    halves = [segments_between(start, middle, 8), segments_between(middle, end, 8)]
    through = [
        1 - backend.opacity(backend.trace(factors, s, torch.full((5,), 0.5), whole_grid()))
        for s in (whole, *halves)
    ]
    torch.testing.assert_close(through[0], through[1] * through[2])


def test_a_straight_ray_in_pieces_is_the_ray_in_one(backend):
    factors = TensorVM((5, 4, 3), (2, 1, 1), scale=0.8, generator=generator(0))
    whole, jitter = with_steps(make_segments(5, seed=1), 16), torch.full((5,), 0.3)
    pieces = chains(
        whole.origins.expand(-1, 3, -1), whole.directions.expand(-1, 3, -1),
        torch.tensor([0.2, 0.55, 1.0]).expand(5, 3), 16,
    )  # fmt: skip
    one, several = (backend.trace(factors, s, jitter, whole_grid()) for s in (whole, pieces))
    torch.testing.assert_close(several.weights, one.weights)
    torch.testing.assert_close(several.positions, one.positions)


def test_the_error_of_quadrature_falls_with_the_step(backend):
    """Density linear along x, samples at the step's start: the error is of first order."""
    factors = constant_factors(0.0, (2, 2, 2))
    with torch.no_grad():
        factors.planes[0][:, :, 0] = torch.tensor([5.0, 10.0])  # softplus of it is it, nearly
    expected = 1 - np.exp(-0.2 * 2 * 7.5)
    errors = []
    for n_steps in (8, 16, 32, 64):
        samples = backend.trace(factors, rays_along_x(1, n_steps), torch.zeros(1), whole_grid(0.2))
        errors.append(abs(float(backend.opacity(samples).detach()) - expected))
    slope = np.polyfit(np.log([8, 16, 32, 64]), np.log(errors), 1)[0]
    assert -1.15 < slope < -0.85


def test_the_order_of_rays_does_not_matter(backend):
    factors = TensorVM((5, 4, 3), (2, 1, 1), scale=0.8, generator=generator(0))
    segments, jitter = make_segments(6, seed=1), torch.rand(6, generator=generator(2))
    order = torch.tensor([3, 0, 5, 1, 4, 2])
    straight = backend.opacity(backend.trace(factors, segments, jitter, whole_grid()))
    mixed = backend.opacity(backend.trace(factors, segments[order], jitter[order], whole_grid()))
    torch.testing.assert_close(mixed, straight[order])


def test_sums_along_rays_are_linear_in_the_values(backend):
    weights, g = torch.rand(7, generator=generator(0)), generator(1)
    a, b = torch.randn(7, 3, generator=g), torch.randn(7, 3, generator=g)
    samples = packed([3, 0, 4], weights)
    apart = 2 * backend.composite(samples, a) - backend.composite(samples, b)
    torch.testing.assert_close(backend.composite(samples, 2 * a - b), apart)


def test_unoccupied_voxels_are_passed_over_and_axes_are_not_mixed_up(backend):
    """One occupied voxel of a grid that is different along each axis."""
    occupancy = torch.zeros(2, 3, 5, dtype=torch.uint8)
    occupancy[1, 0, 3] = 1
    march = March(occupancy, 0.0, 1.0, 0.0)
    lower, upper = torch.tensor([0, -1, 0.2]), torch.tensor([1, -1 / 3, 0.6])
    corners = torch.tensor([[-1.0, -0.99, -0.5], [0.99, -1.0, 1.0], [0.5, 0.9, 0.5]])
    segments = segments_between(corners, torch.tensor([0.5, -0.6, 0.4]).expand(3, 3), 40)
    samples = backend.trace(constant_factors(0.0), segments, torch.full((3,), 0.5), march)
    everything = backend.trace(constant_factors(0.0), segments, torch.full((3,), 0.5), whole_grid())
    inside = ((everything.positions >= lower) & (everything.positions < upper)).all(dim=1)
    assert 0 < len(samples.s) == int(inside.sum())
    assert torch.equal(samples.positions, everything.positions[inside])


def test_an_empty_occupancy_grid_gives_no_samples_and_clear_rays(backend):
    march = March(torch.zeros(2, 2, 2, dtype=torch.uint8), 0.0, 1.0, 0.0)
    samples = backend.trace(constant_factors(1.0), make_segments(5, seed=0), torch.rand(5), march)
    assert len(samples.ray) == 0
    assert torch.equal(samples.offsets, torch.zeros(6, dtype=torch.int64))
    assert torch.equal(backend.composite(samples, torch.zeros(0, 3)), torch.zeros(5, 3))


def test_a_ray_ends_behind_the_sample_that_brings_it_below_the_threshold(backend):
    """Each step has a length of 1 and a density of softplus(0) = log 2: it halves the light."""
    segments = replace(rays_along_x(3, 40), lengths=torch.full((3,), 40.0))
    march = whole_grid(termination=1 / 200)
    samples = backend.trace(constant_factors(0.0), segments, torch.rand(3), march)
    assert samples.offsets.diff().tolist() == [8, 8, 8]
    expected = 0.5 ** torch.arange(1, 9)
    torch.testing.assert_close(samples.weights.detach(), expected.repeat(3))


def test_heavy_samples_keep_their_rays_and_a_faint_ray_keeps_its_heaviest(backend):
    weights = torch.tensor([0.5, 0.01, 0.2, 0.02, 0.3, 0.07, 0.09, 0.04])
    heavy = backend.prune(packed([2, 0, 3, 2, 1], weights), 0.1)
    assert heavy.offsets.tolist() == [0, 1, 1, 3, 4, 4]
    assert heavy.ray.tolist() == [0, 2, 2, 3]
    assert heavy.s.tolist() == [0.0, 2.0, 4.0, 6.0]


def test_of_equally_heavy_samples_of_a_faint_ray_the_first_is_kept(backend):
    heavy = backend.prune(packed([3], torch.tensor([0.0625, 0.09375, 0.09375])), 0.125)
    assert heavy.s.tolist() == [1.0]


@pytest.mark.parametrize(
    ("sums", "expected"),
    [([0.1, 0.1, 0.1], [0, 3, 3]), ([0.5, 0.1, 0.5], [1, 3, 4]), ([2.0, 2.0, 2.0], [3, 3, 5])],
)
def test_a_sum_of_weights_is_reached_at_a_sample_of_its_ray_or_behind_the_last(sums, expected):
    samples = packed([3, 0, 2], torch.tensor([0.2, 0.4, 0.1, 0.3, 0.3]))
    assert samples.reached(torch.tensor(sums)).tolist() == expected
