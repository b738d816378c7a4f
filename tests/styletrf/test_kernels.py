"""Every form of the kernels against the float64 reference, and the reference against its laws."""

from dataclasses import fields, replace

import numpy as np
import pytest
import torch
from torch import Tensor

from styletrf.kernels import FORMS, March, Samples, Segments, kernels_for, reference
from styletrf.tensor_vm import LINE_AXES, PLANE_AXES, TensorVM

FUSED = FORMS["fused"]


def make_segments(n: int, seed: int, max_steps: int = 40, reach: float = 1.0) -> Segments:
    g = torch.Generator().manual_seed(seed)
    origins = reach * (2 * torch.rand(n, 3, generator=g) - 1)
    directions = reach * (2 * torch.rand(n, 3, generator=g) - 1) - origins
    ones = torch.ones(n)
    return Segments(
        origins,
        directions,
        directions.norm(dim=-1),
        torch.randint(0, max_steps + 1, (n,), generator=g),
        directions,
        ones,
        2 * ones,
        ones,
    )


def doubled(segments: Segments) -> Segments:
    values = [getattr(segments, f.name) for f in fields(segments)]
    return Segments(*(v.double() if v.is_floating_point() else v for v in values))


def rays_of(segments: Segments, n_steps: Tensor) -> Segments:
    return replace(segments, n_steps=n_steps)


def loss_of(form, factors, appearance, segments, jitter, march):
    samples = form.trace(factors, segments, jitter, march)
    values = form.features(appearance, samples.positions)
    color = form.composite(samples, values)
    (color.sin().sum() + samples.weights.square().sum()).backward()
    return samples, color.detach()


@pytest.mark.parametrize(
    ("resolution", "n_rays"),
    [((9, 7, 5), 60), ((1, 1, 1), 10), ((2, 1, 6), 20), ((33, 20, 2), 300), ((4, 4, 4), 0)],
)
@pytest.mark.parametrize("ranks", [(4, 3, 2), (1, 1, 1), (16, 8, 8)])
def test_fused_form_equals_the_float64_reference(resolution, n_rays, ranks):
    g = torch.Generator().manual_seed(1)
    segments = make_segments(n_rays, seed=2, reach=1.3)  # some samples lie outside the grid
    jitter = torch.rand(n_rays, generator=g)
    occupancy = (torch.rand(5, 4, 6, generator=g) > 0.3).to(torch.uint8)
    march = March(occupancy, -1.0, 5.0, 1e-3)
    results = {}
    for name, dtype in (("fused", torch.float32), ("reference", torch.float64)):
        g.manual_seed(3)
        density = TensorVM(resolution, ranks, scale=0.8, generator=g).to(dtype)
        appearance = TensorVM(resolution, ranks, scale=0.8, generator=g).to(dtype)
        bundle = segments if dtype == torch.float32 else doubled(segments)
        samples, color = loss_of(FORMS[name], density, appearance, bundle, jitter.to(dtype), march)
        grads = [p.grad for module in (density, appearance) for p in module.parameters()]
        results[name] = (samples, color, grads)
    (ours, our_color, our_grads), (theirs, color, grads) = results["fused"], results["reference"]
    assert torch.equal(ours.offsets, theirs.offsets)
    assert torch.equal(ours.ray, theirs.ray)
    torch.testing.assert_close(ours.weights.double(), theirs.weights, rtol=1e-4, atol=1e-6)
    torch.testing.assert_close(our_color.double(), color, rtol=1e-4, atol=1e-5)
    for mine, exact in zip(our_grads, grads, strict=True):
        torch.testing.assert_close(mine.double(), exact, rtol=1e-3, atol=1e-4)


def test_reference_gradients_are_those_of_finite_differences():
    g = torch.Generator().manual_seed(0)
    factors = TensorVM((3, 4, 2), (2, 1, 1), scale=0.7, generator=g).double()
    segments = doubled(make_segments(4, seed=5, max_steps=6))
    march = March(torch.ones(1, 1, 1, dtype=torch.uint8), 0.0, 1.0, 0.0)
    jitter = torch.rand(4, generator=g).double()
    names = [name for name, _ in factors.named_parameters()]

    def weights(*values: Tensor) -> Tensor:
        def run(module: TensorVM) -> Tensor:
            return reference.trace(module, segments, jitter, march).weights

        holder = _Call(factors, run)
        return torch.func.functional_call(
            holder, {f"module.{n}": v for n, v in zip(names, values, strict=True)}, ()
        )

    inputs = tuple(p.detach().clone().requires_grad_(True) for p in factors.parameters())
    assert torch.autograd.gradcheck(weights, inputs, atol=1e-6)


class _Call(torch.nn.Module):
    def __init__(self, module, run):
        super().__init__()
        self.module, self.run = module, run

    def forward(self):
        return self.run(self.module)


def test_features_are_the_trilinear_interpolation_of_the_dense_tensor():
    """The axes of plane and line are disjoint, so the product of interpolations is exact."""
    g = torch.Generator().manual_seed(4)
    factors = TensorVM((4, 5, 6), (2, 2, 2), generator=g).double()
    dense = torch.zeros(4, 5, 6, dtype=torch.float64)
    for (u, v), w, plane, line in zip(
        PLANE_AXES, LINE_AXES, factors.planes, factors.lines, strict=True
    ):
        for x, y, z in np.ndindex(4, 5, 6):
            index = (x, y, z)
            dense[index] += (plane[index[v], index[u]] * line[index[w]]).sum().detach()
    positions = 2 * torch.rand(50, 3, generator=g).double() - 1
    volume = dense.permute(2, 1, 0)[None, None]  # grid_sample wants depth (z), height, width
    expected = torch.nn.functional.grid_sample(
        volume, positions[None, None, None], align_corners=True, mode="bilinear"
    ).reshape(-1)
    torch.testing.assert_close(reference.density(factors, positions), expected)


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
@pytest.mark.parametrize("scale", [0.0, 1e-30, 1e-8, 1.0, 1e8, 1e30, float("inf")])
@pytest.mark.parametrize("length", [0.0, 1e-10, 1.0, 1e10])
def test_weights_and_gradients_stay_finite_at_extremes(form, scale, length):
    if scale == float("inf") and length == 0.0:
        pytest.skip("infinite density over no length is undefined")
    factors = TensorVM((4, 4, 4), (2, 2, 2), generator=torch.Generator().manual_seed(0))
    segments = replace(make_segments(20, seed=1), lengths=torch.full((20,), length))
    march = March(torch.ones(1, 1, 1, dtype=torch.uint8), 0.0, scale, 0.0)
    samples = form.trace(factors, segments, torch.full((20,), 0.5), march)
    opacity = form.composite(samples, torch.ones(len(samples.ray), 1))[:, 0]
    assert torch.isfinite(samples.weights).all()
    assert (samples.weights >= 0).all()
    assert (opacity <= 1 + 1e-5).all()
    if np.isfinite(scale) and scale * length < 1e30:
        samples.weights.sum().backward()
        assert all(torch.isfinite(p.grad).all() for p in factors.parameters())


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_constant_density_follows_beer_lambert(form):
    """Planes and lines of one make the raw density 3: opacity is 1 - exp(-density x length)."""
    factors = TensorVM((2, 2, 2), (1, 1, 1))
    with torch.no_grad():
        for p in factors.parameters():
            p.fill_(1.0)
    segments = rays_of(make_segments(30, seed=3), torch.full((30,), 17))
    march = March(torch.ones(1, 1, 1, dtype=torch.uint8), 0.0, 0.1, 0.0)
    samples = form.trace(factors, segments, torch.rand(30), march)
    opacity = form.composite(samples, torch.ones(len(samples.ray), 1))[:, 0]
    density = 0.1 * torch.nn.functional.softplus(torch.tensor(3.0))
    torch.testing.assert_close(opacity, 1 - torch.exp(-density * segments.lengths))


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_an_empty_occupancy_grid_gives_no_samples_and_a_clear_ray(form):
    factors = TensorVM((3, 3, 3), (1, 1, 1))
    march = March(torch.zeros(2, 2, 2, dtype=torch.uint8), 0.0, 1.0, 0.0)
    samples = form.trace(factors, make_segments(5, seed=0), torch.rand(5), march)
    assert len(samples.ray) == 0
    assert torch.equal(form.composite(samples, torch.zeros(0, 3)), torch.zeros(5, 3))


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_a_ray_ends_behind_the_first_opaque_sample(form):
    factors = TensorVM((3, 3, 3), (1, 1, 1))
    march = March(torch.ones(1, 1, 1, dtype=torch.uint8), 0.0, 1e9, 1e-4)
    segments = rays_of(make_segments(5, seed=0), torch.full((5,), 30))
    samples = form.trace(factors, segments, torch.rand(5), march)
    assert torch.equal(samples.offsets.diff(), torch.ones(5, dtype=torch.int64))
    torch.testing.assert_close(samples.weights, torch.ones(5))


def test_scatter_does_not_depend_on_the_number_of_threads():
    import numba

    positions = torch.rand(5000, 3) * 2 - 1
    grads = []
    for n_threads in (1, numba.config.NUMBA_NUM_THREADS):
        numba.set_num_threads(n_threads)
        factors = TensorVM((40, 30, 20), (4, 4, 4), generator=torch.Generator().manual_seed(0))
        FUSED.features(factors, positions).square().sum().backward()
        grads.append([p.grad for p in factors.parameters()])
    assert all(torch.equal(a, b) for a, b in zip(*grads, strict=True))


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_heavy_samples_keep_their_rays_and_haze_keeps_its_heaviest(form):
    samples = Samples(
        torch.tensor([0, 2, 2, 5, 7, 8]),
        torch.tensor([0, 0, 2, 2, 2, 3, 3, 4]),
        torch.arange(8.0),
        torch.zeros(8, 3),
        torch.tensor([0.5, 0.01, 0.2, 0.02, 0.3, 0.07, 0.09, 0.04]),
    )
    heavy = form.heavy(samples, 0.1)
    assert heavy.offsets.tolist() == [0, 1, 1, 3, 4, 4]
    assert heavy.ray.tolist() == [0, 2, 2, 3]
    assert heavy.s.tolist() == [0.0, 2.0, 4.0, 6.0]


@pytest.mark.parametrize("threshold", [0.0, 0.02, 2.0])
def test_both_forms_keep_the_same_samples(threshold):
    g = torch.Generator().manual_seed(0)
    ray = torch.randint(0, 50, (1000,), generator=g).sort().values
    offsets = torch.searchsorted(ray, torch.arange(51))
    weights = torch.rand(1000, generator=g) ** 4 / 20
    samples = Samples(offsets, ray, weights, torch.zeros(1000, 3), weights)
    ours, theirs = (form.heavy(samples, threshold) for form in FORMS.values())
    assert torch.equal(ours.offsets, theirs.offsets)
    assert torch.equal(ours.s, theirs.s)


@pytest.mark.parametrize(
    ("n", "inputs", "hidden"), [(0, 5, 8), (1, 1, 1), (7, 6, 3), (500, 48, 64)]
)
def test_fused_colors_and_gradients_equal_the_float64_reference(n, inputs, hidden):
    g = torch.Generator().manual_seed(n)
    ray = torch.randint(0, 40, (n,), generator=g).sort().values
    upstream = torch.randn(n, 3, generator=g)
    shapes = [(n, inputs), (40, hidden), (hidden, inputs), (3, hidden), (3,)]
    values = [torch.randn(shape, generator=g) for shape in shapes]
    results = {}
    for name, dtype in (("fused", torch.float32), ("reference", torch.float64)):
        leaves = [value.detach().to(dtype).requires_grad_() for value in values]
        colors = FORMS[name].decode(*leaves[:2], ray, *leaves[2:])
        colors.backward(upstream.to(dtype))
        results[name] = [colors.detach(), *(leaf.grad for leaf in leaves)]
    for mine, exact in zip(results["fused"], results["reference"], strict=True):
        torch.testing.assert_close(mine.double(), exact, rtol=1e-3, atol=1e-4)


def test_color_gradients_do_not_depend_on_the_number_of_threads():
    import numba

    g = torch.Generator().manual_seed(0)
    ray = torch.randint(0, 300, (5000,), generator=g).sort().values
    shapes = [(5000, 12), (300, 16), (16, 12), (3, 16), (3,)]
    grads = []
    for n_threads in (1, numba.config.NUMBA_NUM_THREADS):
        numba.set_num_threads(n_threads)
        g.manual_seed(1)
        leaves = [torch.randn(shape, generator=g).requires_grad_() for shape in shapes]
        FUSED.decode(*leaves[:2], ray, *leaves[2:]).square().sum().backward()
        grads.append([leaf.grad for leaf in leaves])
    assert all(torch.equal(a, b) for a, b in zip(*grads, strict=True))


def test_the_fastest_form_is_chosen_and_can_be_overridden():
    cpu = torch.device("cpu")
    assert kernels_for(cpu).name == "fused"
    assert kernels_for(cpu, "reference").name == "reference"
