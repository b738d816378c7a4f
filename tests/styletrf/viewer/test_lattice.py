"""The stored part of a lattice is all that samples interpolate between."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lattice_positions import addresses, corners, positions_in

from styletrf.viewer.lattice import BrickLattice, brick_lattice, empty_distances, occupied_cells

SHAPES = st.tuples(*[st.integers(2, 12)] * 3)


def occupancy(seed: int, shape, fraction: float = 0.1) -> np.ndarray:
    return (np.random.default_rng(seed).random(shape) < fraction).astype(np.uint8)


def lattice_of(occupied: np.ndarray, resolution) -> BrickLattice:
    return brick_lattice(occupied_cells(occupied, resolution), resolution)


@given(st.integers(0, 99), SHAPES, st.tuples(*[st.integers(2, 30)] * 3))
def test_all_points_around_a_sample_are_stored(seed, shape, resolution):
    occupied = occupancy(seed, shape)
    lattice = lattice_of(occupied, resolution)
    of_points, weights = corners(lattice, positions_in(occupied, seed))
    counted = weights > 1e-6
    assert (of_points[counted] >= 0).all()
    assert lattice.needed.ravel()[of_points[counted]].all()
    np.testing.assert_allclose(weights.sum(axis=1), 1)


@given(st.integers(0, 99), SHAPES, st.tuples(*[st.integers(2, 30)] * 3))
def test_addresses_lead_to_the_points_and_no_brick_is_idle(seed, shape, resolution):
    lattice = lattice_of(occupancy(seed, shape), resolution)
    assert lattice.needed.any(axis=1).all()
    stored = np.flatnonzero(lattice.needed)
    np.testing.assert_array_equal(addresses(lattice, lattice.points()[stored]), stored)


@given(st.integers(0, 99), SHAPES)
def test_empty_distances_are_those_of_the_nearest_occupied_voxel(seed, shape):
    occupied = occupancy(seed, shape, 0.02)
    occupied[0, 0, 0] = 1
    every, near = np.argwhere(np.ones(shape)), np.argwhere(occupied)
    expected = np.abs(every[:, None] - near).max(axis=2).min(axis=1).clip(max=5)
    np.testing.assert_array_equal(empty_distances(occupied, 5).ravel(), expected)


@pytest.mark.parametrize("resolution", [(2, 2, 2), (9, 8, 17)])
def test_interpolation_is_exact_for_what_is_linear_along_each_axis(resolution):
    lattice = lattice_of(np.ones((1, 1, 1), np.uint8), resolution)
    at = np.random.default_rng(0).uniform(-1, 1, (50, 3))

    def of(x, y, z):
        return 1 + x - 2 * y * z + 3 * x * y * z

    values = of(*(2 * lattice.points() / (np.array(resolution) - 1) - 1).T)
    of_points, weights = corners(lattice, at)
    np.testing.assert_allclose((weights * values[of_points]).sum(axis=1), of(*at.T))
