"""Factors, their files in half precision, and occupancy: borders, sizes and what 16 bits hold."""

from dataclasses import replace

import pytest
import torch
from kernel_cases import REFERENCE, constant_factors, generator
from stability import half_rounding

from styletrf.field.field_config import FieldConfig
from styletrf.field.kernels import kernels_for
from styletrf.field.occupancy import occupied_voxels
from styletrf.field.radiance_field import RadianceField, load_field, save_field
from styletrf.field.tensor_vm import LINE_AXES, PLANE_AXES, TensorVM

FACTORS = pytest.mark.extremes("TensoRF factors: interpolation, upsampling, regularizers")
FILES = pytest.mark.extremes("Field files")
OCCUPANCY = pytest.mark.extremes("Occupancy")
KERNELS = kernels_for(torch.device("cpu"))
SMALLEST = 2.0**-149  # above 0 in float32
SMALL = FieldConfig((2, 1, 1), (2, 1, 1), features=4, hidden=8)


def corners() -> torch.Tensor:
    signs = torch.tensor([-1.0, 1.0])
    return torch.cartesian_prod(signs, signs, signs)


def at_lattice(factors: TensorVM, positions: torch.Tensor) -> torch.Tensor:
    """The products of the lattice points that corners lie on."""
    columns = []
    ends = [torch.where(positions[:, a] > 0, factors.resolution[a] - 1, 0) for a in range(3)]
    for (u, v), w, plane, line in zip(
        PLANE_AXES, LINE_AXES, factors.planes, factors.lines, strict=True
    ):
        columns.append(plane.double()[ends[v], ends[u]] * line.double()[ends[w]])
    return torch.cat(columns, dim=1)


@FACTORS
@pytest.mark.parametrize("beyond", [0.0, 1e-7, 1.0, 1e30])
def test_corners_of_the_grid_are_lattice_points_and_so_is_what_lies_beyond(
    backend, beyond, stability
):
    factors = TensorVM((4, 3, 5), (2, 1, 2), generator=generator(0))
    found = backend.features(factors, corners() * (1 + beyond))
    expected = at_lattice(factors, corners())
    torch.testing.assert_close(found.double(), expected, rtol=1e-6, atol=1e-9)
    stability(f"{beyond:g} beyond the border", found, expected)


@FACTORS
@pytest.mark.parametrize("size", [1e-38, 1e-19, 1e-6, 1e6, 1e18])
def test_products_of_factors_of_any_size(backend, size, stability):
    """Below 1e-19 a product of two is below what float32 holds; above 1e19 it would overflow."""
    factors = TensorVM((4, 3, 5), (2, 1, 2), scale=size, generator=generator(0))
    positions = 2 * torch.rand(50, 3, generator=generator(1)) - 1
    exact = REFERENCE.features(
        TensorVM((4, 3, 5), (2, 1, 2), scale=size, generator=generator(0)).double(),
        positions.double(),
    )
    found = backend.features(factors, positions)
    torch.testing.assert_close(found.double(), exact, rtol=1e-4, atol=1e-6 * size**2 + 1e-44)
    is_lost = size < 1e-20  # of products below the least number
    within = SMALLEST if is_lost else None
    stability(f"factors of {size:g}", found, exact, within=within, absolute=is_lost)


@FACTORS
@pytest.mark.parametrize("resolution", [(1, 1, 1), (2, 2, 2), (257, 3, 65)])
def test_upsampling_keeps_within_the_range_of_the_factors(resolution, stability):
    factors = TensorVM((2, 1, 3), (2, 1, 1), scale=1e10, generator=generator(0))
    finer, exact = factors.upsampled(resolution), factors.double().upsampled(resolution)
    for fine, coarse in zip(finer.planes, factors.planes, strict=True):
        assert fine.abs().max() <= coarse.abs().max() * (1 + 1e-6)
    stability(f"to {'x'.join(map(str, resolution))}", finer.planes[0], exact.planes[0])


@FACTORS
@pytest.mark.parametrize("size", [0.0, 1e-30, 1e10, 1e18])
def test_regularizers_of_factors_of_any_size_have_finite_gradients(size, stability):
    factors = TensorVM((4, 4, 4), (2, 1, 1), scale=size, generator=generator(0))
    total = factors.total_variation() + factors.l1()
    total.backward()
    assert torch.isfinite(total)
    assert all(torch.isfinite(p.grad).all() for p in factors.parameters())
    exact = factors.double().total_variation() + factors.l1()
    stability(f"factors of {size:g}", total, exact)


@FILES
@pytest.mark.parametrize(
    ("size", "stored"),
    [(0.0, "float16"), (1e-9, "float16"), (1e-6, "float16"), (0.1, "float16"), (6e4, "float16"),
     (7e4, "float32"), (1e30, "float32")],
)  # fmt: skip
def test_factors_return_from_their_file_within_half_precision(tmp_path, size, stored, stability):
    """Subnormal halves are 6e-8 apart, others 1 in 2048; what half cannot hold stays float32."""
    field = RadianceField(SMALL, (4, 3, 5), generator(0))
    plane = field.appearance.factors.planes[0]
    with torch.no_grad():
        plane.copy_(size * (2 * torch.rand(plane.shape, generator=generator(1)) - 1))
        plane[0, 0, 0] = size
    save_field(tmp_path, field)
    found = load_field(tmp_path).appearance.factors.planes[0]
    rounding = 2.0**-11 * plane.abs() + 2.0**-25 if stored == "float16" else 0 * plane
    assert ((found - plane).abs() <= rounding).all()
    within = half_rounding(size) if stored == "float16" else 0.0
    stability(f"factors up to {size:g}", found, plane, precision=stored, within=within)


@OCCUPANCY
@pytest.mark.parametrize("raw", [-1e30, 0.0, 1e30])
@pytest.mark.parametrize("scale", [0.0, 1e-30, 1.0, 1e30, float("inf")])
@pytest.mark.parametrize("settled", [False, True])
def test_a_uniform_density_is_occupied_everywhere(raw, scale, settled):
    """By its opacity, or since nothing would be: an empty grid never recovers."""
    density = RadianceField(replace(SMALL, density_shift=0.0), (5, 5, 5), generator(0)).density
    density.factors, density.scale = constant_factors(raw, (5, 5, 5)), min(scale, 1e30)
    for step in (0.0, 1e-30, 1.0):
        assert occupied_voxels(density, KERNELS, step, 0.01, settled=settled).all()
