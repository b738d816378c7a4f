"""Products of what views observe of points, against those of dense rows."""

import numpy as np
import pytest

from styletrf.scene.shared_products import shared_products


@pytest.mark.parametrize("fraction", [0.02, 0.12, 0.9])
@pytest.mark.parametrize("terms", [1, 2])
def test_products_of_short_and_long_tracks_are_those_of_dense_rows(fraction, terms):
    rng = np.random.default_rng(0)
    seen = rng.random((500, 60)) < fraction
    point, view = np.nonzero(seen)
    values = rng.normal(size=(terms, len(point)))
    dense = np.zeros((terms, *seen.shape))
    dense[:, point, view] = values
    rows = dense.transpose(1, 0, 2).reshape(len(seen), -1)
    _, numbers = np.unique(point, return_inverse=True)
    np.testing.assert_allclose(
        shared_products(numbers, view, values, 60), rows.T @ rows, atol=1e-10
    )


def test_a_view_that_observes_a_point_twice_counts_by_the_sum():
    point, view = np.array([0, 0, 1]), np.array([3, 3, 0])
    products = shared_products(point, view, np.array([[1.0, 2.0, 5.0]]), 20)
    assert (products[3, 3], products[0, 0], np.count_nonzero(products)) == (9, 25, 2)
