"""Occupancy: where density is and one voxel around, never nowhere."""

import pytest
import torch

from styletrf.field.field_config import FieldConfig
from styletrf.field.kernels import kernels_for
from styletrf.field.occupancy import occupied_voxels, remaining, without
from styletrf.field.radiance_field import Density

KERNELS = kernels_for(torch.device("cpu"))


def slab(opaque: float = 40.0) -> Density:
    """Opaque in the upper half of x, empty in the lower."""
    density = Density(FieldConfig((1, 1, 1), (1, 1, 1)), (17, 17, 17))
    with torch.no_grad():
        for factor in density.factors.parameters():
            factor.zero_()
        density.factors.planes[0][:, 9:] = opaque
        density.factors.lines[0].fill_(1)
    return density


def test_voxels_are_occupied_where_there_is_density_and_one_around():
    occupied = occupied_voxels(slab(), KERNELS, 0.05, 0.01)
    assert occupied.shape == (8, 8, 8)
    assert occupied.unique_consecutive(dim=0)[:, 0, 0].tolist() == [0, 1]
    assert occupied[:3].sum() == 0
    assert occupied[3:].all()


def test_more_is_occupied_at_a_lower_opacity_and_a_longer_step():
    generator = torch.Generator().manual_seed(0)
    density = Density(FieldConfig((4, 4, 4), (1, 1, 1)), (17, 17, 17), generator)

    def count(step_length, min_alpha):
        return int(occupied_voxels(density, KERNELS, step_length, min_alpha).sum())

    assert count(0.01, 0.02) >= count(0.01, 0.05)
    assert count(0.02, 0.05) >= count(0.01, 0.05)


@pytest.mark.extremes("Occupancy")
def test_where_nothing_is_everything_counts_as_occupied():
    assert occupied_voxels(slab(opaque=0.0), KERNELS, 0.05, 0.5).all()


@pytest.mark.extremes("Occupancy")
def test_a_lattice_of_one_point_has_an_occupancy():
    density = Density(FieldConfig((1, 1, 1), (1, 1, 1)), (1, 1, 1))
    assert occupied_voxels(density, KERNELS, 0.1, 0.01).shape == (2, 2, 2)


@pytest.mark.parametrize("voxels", [2, 3, 6, 7, 12, 20])
def test_a_voxel_remains_where_it_meets_one_of_a_former_grid_of_any_size(voxels):
    former = (torch.rand(6, 2, 4, generator=torch.Generator().manual_seed(0)) > 0.7).byte()
    parts = former.repeat_interleave(voxels, dim=0).unflatten(0, (voxels, 6))
    expected = parts.amax(dim=1)
    assert torch.equal(remaining(torch.ones_like(expected), former), expected)


@pytest.mark.parametrize("voxels", [40, 64, 112])
@pytest.mark.parametrize("free_cells", [1, 20, 63])
def test_a_voxel_is_free_by_the_cell_that_its_middle_lies_in(voxels, free_cells):
    free = torch.zeros(64, 64, 64, dtype=torch.bool)
    free[:free_cells] = True
    occupied = without(torch.ones(voxels, 2, 2, dtype=torch.bool), free)
    expected = [(2 * k + 1) * 64 // (2 * voxels) >= free_cells for k in range(voxels)]
    assert occupied[:, 0, 0].tolist() == expected


def test_what_is_settled_has_no_neighbors():
    occupied = occupied_voxels(slab(), KERNELS, 0.05, 0.01, settled=True)
    assert occupied.shape == (8, 8, 8)
    assert occupied[:4].sum() == 0
    assert occupied[4:].all()


def test_what_is_settled_is_seen_off_the_centers_of_voxels():
    """A wall thinner than a voxel, between the centers of two."""
    density = slab()
    with torch.no_grad():
        density.factors.planes[0].zero_()
        density.factors.planes[0][:, 9] = 40.0
    occupied = occupied_voxels(density, KERNELS, 0.05, 0.9, settled=True)
    assert occupied.any()
    assert occupied.sum() < 3 * 8 * 8
