"""Contraction: one to one, without gaps between its parts, straight within them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from styletrf.geometry.space import Space
from styletrf.scene.contraction import INNER, contraction

REACH = 100.0
SPACE = Space("unbounded", contraction(REACH), (2.0, 2.0, 2.0), 1e-6)


def points(seed: int, n: int = 200) -> np.ndarray:
    """Of all sizes up to the end of the grid."""
    rng = np.random.default_rng(seed)
    directions = rng.uniform(-1, 1, (n, 3))
    directions /= np.abs(directions).max(axis=1, keepdims=True)
    return directions * np.exp(rng.uniform(np.log(1e-3), np.log(REACH), (n, 1)))


@given(st.integers(0, 10**6))
def test_the_inner_box_is_as_it_was_and_what_is_beyond_comes_back(seed):
    world = points(seed)
    grid = SPACE.to_grid(world)
    inside = np.abs(world).max(axis=1) <= 1
    np.testing.assert_allclose(grid[inside], INNER * world[inside])
    assert (np.abs(grid[~inside]).max(axis=1) >= INNER - 1e-12).all()
    assert (np.abs(grid) <= 1 + 1e-12).all()
    np.testing.assert_allclose(SPACE.to_world(grid), world, rtol=1e-6)


@given(st.integers(0, 10**6))
def test_the_inner_box_and_what_is_beyond_meet_without_a_step(seed):
    rng = np.random.default_rng(seed)
    on_face = rng.uniform(-1, 1, (50, 3))
    on_face[:, seed % 3] = rng.choice([-1, 1], 50)
    grid = SPACE.to_grid(on_face)
    moved = SPACE.to_grid((on_face * (1 + 1e-9 * rng.standard_normal((8, 50, 3)))).reshape(400, 3))
    np.testing.assert_allclose(
        moved.reshape(8, 50, 3), np.broadcast_to(grid, (8, 50, 3)), atol=1e-7
    )


@pytest.mark.extremes("Spaces: box, NDC, contraction")
def test_corners_of_the_grid_that_nothing_is_mapped_to_are_nowhere():
    assert np.isnan(SPACE.to_world(np.array([[0.9, 0.9, 0.0]]))).all()
