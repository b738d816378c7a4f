"""Every backend of the kernels at the extremes of density, length, coordinates and weights."""

from dataclasses import replace

import pytest
import torch
from kernel_cases import (
    REFERENCE,
    constant_factors,
    exact_trace,
    generator,
    make_segments,
    packed,
    segments_between,
    whole_grid,
)

from styletrf.field.kernels import March
from styletrf.field.tensor_vm import TensorVM

pytestmark = pytest.mark.extremes("Kernels: density, transmittance, weights")

LENGTHS = [0.0, 1e-30, 1e-10, 1.0, 1e10, 1e30, float("inf")]
SCALES = [0.0, 1e-30, 1e-8, 1.0, 1e8, 1e30, float("inf")]


def rays_of_lengths(lengths=LENGTHS, n_steps=5):
    segments = make_segments(len(lengths), seed=1)
    return replace(
        segments,
        lengths=torch.tensor(lengths),
        n_steps=torch.full((len(lengths),), n_steps),
    )


def traced(backend, factors, segments, march):
    """The samples, and the gradients of a loss that weighs each sample differently."""
    samples = backend.trace(factors, segments, torch.full((len(segments),), 0.5), march)
    upstream = torch.randn(len(samples.s), generator=generator(9))
    (samples.weights * upstream).sum().backward()
    return samples, [p.grad for p in factors.parameters()]


def assert_finite(*tensors):
    for tensor in tensors:
        assert torch.isfinite(tensor).all()


@pytest.mark.parametrize("scale", SCALES)
def test_weights_and_gradients_are_finite_and_light_is_conserved(backend, scale, stability):
    """Whatever density and length: weights and what gets through add up to 1."""
    factors = TensorVM((4, 4, 4), (2, 2, 2), generator=generator(0))
    segments, march = rays_of_lengths(), whole_grid(scale)
    samples, gradients = traced(backend, factors, segments, march)
    assert_finite(samples.weights, *gradients)
    assert (samples.weights >= 0).all()
    exact = exact_trace(factors, segments, torch.full((len(segments),), 0.5), march)
    stability(f"density times {scale:g}, lengths 0 to infinity", samples.weights, exact.weights)
    raw = backend.density(factors, samples.positions).detach().double()
    thickness = segments.step_thickness(scale).double()[samples.ray]
    tau = (thickness * torch.nn.functional.softplus(raw)).detach()
    through = torch.exp(-torch.zeros(len(segments)).double().index_add(0, samples.ray, tau))
    opacity = backend.opacity(samples).detach().double()
    torch.testing.assert_close(opacity + through, torch.ones_like(through), atol=1e-5, rtol=0)


@pytest.mark.parametrize("raw", [-1e30, -1e4, -80.0, 0.0, 100.0, 1e4, 1e30])
@pytest.mark.parametrize("scale", [1e-30, 25.0, 1e30])
def test_raw_densities_of_any_size_have_the_opacity_of_the_closed_form(
    backend, raw, scale, stability
):
    """Softplus and its slope neither overflow nor turn into NaN."""
    factors = constant_factors(raw)
    samples, gradients = traced(backend, factors, rays_of_lengths(LENGTHS[:6]), whole_grid(scale))
    assert_finite(samples.weights, *gradients)
    softplus = torch.nn.functional.softplus(torch.tensor(raw).double())
    thickness = rays_of_lengths(LENGTHS[:6]).step_thickness(scale).double()
    expected = -torch.expm1(-5 * thickness * softplus)
    opacity = backend.opacity(samples).detach().double()
    torch.testing.assert_close(opacity, expected, rtol=1e-4, atol=1e-37)
    stability(f"raw density {raw:g}, times 1e-30 to 1e30", opacity.float(), expected)


def test_thin_fog_keeps_its_relative_accuracy(backend, stability):
    """1 - exp(-tau) taken literally is 0 below 6e-8."""
    tau = torch.tensor([1e-30, 1e-20, 1e-12, 1e-8, 1e-6, 1e-4, 1e-2, 0.3, 0.49, 0.51, 1.0, 3.0])
    segments = rays_of_lengths((tau / torch.log(torch.tensor(2.0))).tolist(), n_steps=1)
    samples = backend.trace(constant_factors(0.0), segments, torch.zeros(12), whole_grid())
    expected = -torch.expm1(-tau.double())
    torch.testing.assert_close(samples.weights.detach().double(), expected, rtol=2e-6, atol=0)
    stability("optical thickness 1e-30 to 3, each", (samples.weights / expected).float(), tau**0)


@pytest.mark.parametrize("raw", [-60.0, -30.0, -17.0, -7.0, -1.0, -0.1, 0.0, 0.1, 1.0, 7.0, 40.0])
def test_softplus_keeps_its_relative_accuracy(backend, raw, stability):
    segments = rays_of_lengths([1e-6 / max(raw, 1.0)], n_steps=1)
    samples = backend.trace(constant_factors(raw), segments, torch.zeros(1), whole_grid())
    tau = segments.lengths.double() * torch.log1p(torch.exp(torch.tensor(raw).double()))
    weights = samples.weights.detach().double()
    torch.testing.assert_close(weights, -torch.expm1(-tau), rtol=1e-5, atol=0)
    stability("raw density -60 to 40, each", weights.float(), -torch.expm1(-tau))


@pytest.mark.parametrize("tau", [1e-6, 1e-3, 1.0])
def test_thousands_of_samples_add_up(backend, tau, stability):
    """Also where each adds less than the rounding of the sum."""
    n_steps = 5000
    length = n_steps * tau / torch.log(torch.tensor(2.0))
    segments = rays_of_lengths([float(length)], n_steps)
    samples = backend.trace(constant_factors(0.0), segments, torch.zeros(1), whole_grid())
    expected = -torch.expm1(-torch.tensor([n_steps * tau]).double())
    opacity = backend.opacity(samples).detach()
    torch.testing.assert_close(opacity.double(), expected, rtol=1e-4, atol=0)
    stability(f"{n_steps} samples of thickness {tau:g}", opacity, expected, within=1e-4)


def test_an_opaque_first_sample_hides_all_others(backend, stability):
    """Also an infinitely dense one, and nothing behind it gets a gradient."""
    for scale in (1e4, 1e8, 1e30, float("inf")):
        factors = constant_factors(1.0)
        samples, gradients = traced(
            backend, factors, rays_of_lengths([1.0, 1.0], 70), whole_grid(scale)
        )
        first = samples.offsets[:-1]
        stability(f"density times {scale:g}", samples.weights[first], torch.ones(2))
        assert int((samples.weights > 1e-6).sum()) == 2
        assert all((g == 0).all() for g in gradients)


def test_a_ray_ends_behind_an_opaque_first_sample(backend, stability):
    for scale in (1e9, float("inf")):
        march = whole_grid(scale, termination=1e-4)
        samples = backend.trace(
            constant_factors(1.0), rays_of_lengths([1.0] * 4), torch.rand(4), march
        )
        assert samples.offsets.diff().tolist() == [1, 1, 1, 1]
        stability(f"density times {scale:g}", samples.weights, torch.ones(4))


def test_an_opaque_last_sample_is_seen(backend, stability):
    """An opaque far plane is seen: the density is in the last of the steps."""
    occupancy = torch.zeros(8, 1, 1, dtype=torch.uint8)
    occupancy[-1] = 1
    along_x = segments_between(torch.tensor([[-1.0, 0.0, 0.0]]), torch.tensor([[1.0, 0.0, 0.0]]), 8)
    march = March(occupancy, 0.0, 1e3, 0.0)
    samples = backend.trace(constant_factors(1.0), along_x, torch.full((1,), 0.5), march)
    stability("density times 1000", backend.opacity(samples), torch.ones(1))


def test_a_transparent_ray_has_samples_without_weight(backend):
    """Density 0: nothing is seen, and every sample still can gain a density."""
    factors = constant_factors(-30.0)
    samples, gradients = traced(backend, factors, rays_of_lengths([1.0] * 3), whole_grid())
    assert samples.offsets.diff().tolist() == [5, 5, 5]
    assert (samples.weights < 1e-12).all()
    assert gradients[0].abs().max() > 0


@pytest.mark.parametrize("far", [1e6, 1e19, 1e30, float("inf")])
def test_coordinates_far_outside_are_those_of_the_border(backend, far, stability):
    factors = TensorVM((4, 3, 5), (2, 1, 2), generator=generator(0))
    corners = torch.tensor([[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0]])
    at_border = backend.features(factors, corners)
    torch.testing.assert_close(backend.features(factors, far * corners), at_border)
    stability(f"coordinates {far:g}", backend.features(factors, far * corners), at_border)
    occupancy = torch.zeros(3, 3, 3, dtype=torch.uint8)
    occupancy[2, 2, 2] = 1  # the voxel at the first corner alone
    segments = segments_between(min(far, 1e37) * corners, 2 * min(far, 1e37) * corners, 3)
    march = March(occupancy, 0.0, 1.0, 0.0)
    samples = backend.trace(factors, segments, torch.full((3,), 0.5), march)
    assert samples.offsets.diff().tolist() == [3, 0, 0]


def test_rays_along_faces_edges_and_axes_of_the_grid(backend):
    """Faces belong to the grid, also along directions with zeros."""
    ends = torch.tensor([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    starts = torch.tensor([[-1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    factors = TensorVM((1, 5, 2), (2, 1, 2), generator=generator(0))
    occupancy = torch.ones(2, 3, 4, dtype=torch.uint8)
    march = March(occupancy, 0.0, 1.0, 0.0)
    samples, gradients = traced(backend, factors, segments_between(starts, ends, 6), march)
    assert samples.offsets.diff().tolist() == [6, 6, 6, 6]
    assert_finite(samples.weights, *gradients)


def test_rays_without_length_or_steps_have_no_weight(backend):
    """A ray that misses has no steps; one whose ends are one point is a point."""
    point = torch.zeros(3, 3)
    segments = segments_between(point, point, torch.tensor([0, 1, 4]))
    samples, gradients = traced(backend, constant_factors(1.0), segments, whole_grid())
    assert samples.offsets.tolist() == [0, 0, 1, 5]
    assert (samples.weights == 0).all()
    assert_finite(*gradients)


def test_nan_in_a_factor_reaches_the_weights_and_the_heavy_samples(backend, stability):
    """So that a guard can see it: nothing drops it on the way."""
    for tensors in ("planes", "lines"):
        factors = constant_factors(0.0, (3, 3, 3))
        with torch.no_grad():
            getattr(factors, tensors)[0][-1] = torch.nan
        march = whole_grid(termination=1e-3)
        samples = backend.trace(factors, rays_of_lengths([1.0] * 4, 20), torch.rand(4), march)
        assert samples.weights.isnan().any()
        heavy = backend.prune(samples, 0.01)
        assert heavy.weights.isnan().sum() == samples.weights.isnan().sum()
        assert backend.opacity(heavy).isnan().any()
        exact = REFERENCE.trace(
            factors, rays_of_lengths([1.0] * 4, 20), torch.full((4,), 0.5), march
        )
        ours = backend.trace(factors, rays_of_lengths([1.0] * 4, 20), torch.full((4,), 0.5), march)
        assert torch.equal(ours.offsets, exact.offsets)
        assert torch.equal(ours.weights.isnan(), exact.weights.isnan())
        stability(f"NaN in the last column of {tensors}", ours.weights, exact.weights)


def test_nan_in_components_reaches_the_colors(backend):
    ray = torch.arange(3)
    components = torch.ones(3, 4)
    components[1] = torch.nan
    colors = backend.decode(
        components, torch.ones(3, 5), ray, torch.ones(5, 4), torch.ones(3, 5), ray * 0.0
    )
    assert colors.isnan().tolist() == [[False] * 3, [True] * 3, [False] * 3]


def test_a_nan_coordinate_reads_within_bounds_and_gives_nan(backend):
    factors = TensorVM((4, 3, 5), (2, 1, 2), generator=generator(0))
    positions = torch.zeros(4, 3)
    positions[0, 0], positions[1, 1], positions[2, 2] = torch.nan, torch.nan, torch.nan
    values = backend.features(factors, positions)
    assert values.isnan().any(dim=1).tolist() == [True, True, True, False]
    assert backend.density(factors, positions).isnan().tolist() == [True, True, True, False]
    segments = segments_between(positions, positions + 0.5, 3)
    samples = backend.trace(factors, segments, torch.full((4,), 0.5), whole_grid())
    assert samples.weights.isnan().tolist() == [True] * 9 + [False] * 3


def test_gradients_of_nan_coordinates_stay_within_bounds(backend):
    """In the middle of the grid they are those of another row, as it has them alone."""
    nan, middle = torch.full((2, 3), torch.nan), torch.tensor([[0.1, -0.1, 0.05]])
    alone, among = (TensorVM((8, 7, 9), (2, 1, 2), generator=generator(0)) for _ in range(2))
    backend.features(alone, middle).sum().backward()
    backend.features(among, torch.cat([nan, middle, nan])).sum().backward()
    for own, found in zip(alone.parameters(), among.parameters(), strict=True):
        is_touched = own.grad != 0
        assert is_touched.any()
        torch.testing.assert_close(found.grad[is_touched], own.grad[is_touched])


@pytest.mark.parametrize("weight", [0.0, 1e-45, 1e-38, 1.0])
def test_sums_of_weights_of_any_size(backend, weight, stability):
    weights = torch.full((3,), weight, requires_grad=True)
    values = torch.tensor([[0.0], [1.0], [1e30]], requires_grad=True)
    sums = backend.composite(packed([3], weights), values)
    sums.sum().backward()
    assert_finite(sums, weights.grad, values.grad)
    stability(f"weights {weight:g}, values to 1e30", sums[0, 0], weights[0].double() * (1 + 1e30))
