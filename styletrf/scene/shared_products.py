"""Adds up, over points, the products of the observations of a point in each pair of views.

Of many views, most points are seen by few: then pairs of observations are listed. Points that many
views see are multiplied as dense rows.
"""

from itertools import product

import numpy as np
from jaxtyping import Float, Int

_AT_ONCE = 4096  # points
_SHORT_TRACK = 1 / 8  # of the views, up to which pairs are faster than dense rows


def shared_products(
    point: Int[np.ndarray, " observations"],
    view: Int[np.ndarray, " observations"],
    values: Float[np.ndarray, "terms observations"],
    n_views: int,
) -> Float[np.ndarray, "unknowns unknowns"]:
    """Returns the products of the values that two views have of a point, added up over points.

    Rows and columns are the terms one after another, and the views in each.

    Args:
        point: The point of each observation, ascending.
        view: The view of each observation.
        values: The values of each observation.
        n_views: The number of views.
    """
    is_short = np.bincount(point)[point] <= _SHORT_TRACK * n_views
    short, long = np.flatnonzero(is_short), np.flatnonzero(~is_short)
    products = _products_by_points(point[long], view[long], values[:, long], n_views)
    products += _products_by_pairs(point[short], view[short], values[:, short], n_views)
    return products


def _products_by_pairs(
    point: Int[np.ndarray, " observations"],
    view: Int[np.ndarray, " observations"],
    values: Float[np.ndarray, "terms observations"],
    n_views: int,
) -> Float[np.ndarray, "unknowns unknowns"]:
    """Adds up the pairs of observations of one point: those that are 0, 1, 2, ... places apart."""
    n_terms = len(values)
    sums = np.zeros((n_terms, n_terms, n_views**2))
    first = second = np.arange(len(point))
    while len(first):
        cell = view[first] * n_views + view[second]
        half = 0.5 if first[0] == second[0] else 1.0  # a pair of one observation has no mirror
        for a, b in product(range(n_terms), repeat=2):
            np.add.at(sums[a, b], cell, half * values[a, first] * values[b, second])
        within = np.flatnonzero(second + 1 < len(point))
        first, second = first[within], second[within] + 1
        same = point[first] == point[second]
        first, second = first[same], second[same]
    halves = sums.reshape(n_terms, n_terms, n_views, n_views).transpose(0, 2, 1, 3)
    upper = halves.reshape(n_terms * n_views, n_terms * n_views)
    return np.asarray(upper + upper.T)


def _products_by_points(
    point: Int[np.ndarray, " observations"],
    view: Int[np.ndarray, " observations"],
    values: Float[np.ndarray, "terms observations"],
    n_views: int,
) -> Float[np.ndarray, "unknowns unknowns"]:
    """Adds up the outer products of points, some thousand at a time."""
    unknowns = len(values) * n_views
    products = np.zeros((unknowns, unknowns))
    numbers, row = np.unique(point, return_inverse=True)
    for first in range(0, len(numbers), _AT_ONCE):
        here = (row >= first) & (row < first + _AT_ONCE)
        cell = (row[here] - first) * n_views + view[here]
        cells = (int(row[here].max()) - first + 1) * n_views
        sums = [np.bincount(cell, term[here], cells).reshape(-1, n_views) for term in values]
        design = np.concatenate(sums, axis=1)
        products += design.T @ design
    return products
