"""Estimates the exposures of photographs relative to each other, by the points that they share.

A photograph shows a color c of the scene as

    c_view = MIDDLE (c / MIDDLE)^power gain,

channel by channel: a straight line in the logarithms, log_gain its value at a middle gray. Exposure
and white balance are gains, tone curves are powers. The lines of all views and the log colors of
all points are fitted together to the observed log colors, by least absolute residuals:
observations that highlights or occlusion spoil do not shift them. A change common to all views
could be one of the points as well, so the median of the views is the identity.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from styletrf.geometry.point_table import SparsePoints
from styletrf.scene.shared_products import shared_products

MIDDLE = 0.4  # of encoded colors from 0 to 1: between their median and mid-gray
LEAST_OBSERVATIONS = 16  # of points that others see as well, for a view to have an exposure
_SMALL = 0.02  # residuals below it count by their squares
_POWERS = 0.2, 5.0  # of a view that has nothing to do with the others
_ITERATIONS = 12  # of reweighting
_RIDGE = 1e-6, 1e-3  # of gains and powers, times the mean weight of a view: 0 without evidence


Channels = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Exposure:
    """One view's log gain and power in each channel."""

    log_gain: Channels
    power: Channels


@dataclass(frozen=True, slots=True)
class Exposures:
    """The log gain and the power of each view and channel; 0 and 1 are the identity."""

    log_gain: Float[np.ndarray, "views channels"]
    power: Float[np.ndarray, "views channels"]

    def log_change(
        self, log_color: Float[np.ndarray, " levels"]
    ) -> Float[np.ndarray, "views channels levels"]:
        """Returns the term that each view adds to the logarithm of a color, of encoded values."""
        slope = self.power[..., None] - 1
        return np.asarray(self.log_gain[..., None] + slope * (log_color - np.log(MIDDLE)))

    def evened(
        self, color: Float[np.ndarray, "colors channels"], view: Int[np.ndarray, " colors"]
    ) -> Float[np.ndarray, "colors channels"]:
        """Returns the colors of the scene that views show as `color`; darkness stays dark."""
        scaled = np.maximum(color, 0) / (MIDDLE * np.exp(self.log_gain[view]))
        return np.asarray(MIDDLE * scaled ** (1 / self.power[view]))


def estimate_exposures(
    points: SparsePoints,
    log_color: Float[np.ndarray, "observations channels"],
    views: int,
    *,
    powers: bool = True,
) -> Exposures:
    """Returns each view's exposure, of which the median over the views is the identity.

    Args:
        points: The points with their tracks.
        log_color: The natural logarithm of the encoded values of each observation; NaN does not
            count.
        views: The number of views; one that shares too few points gets the identity.
        powers: Whether powers are estimated as well; else they are 1.
    """
    fitted = [_fitted(points, values, views, powers=powers) for values in log_color.T]
    return Exposures(*(np.stack(part, axis=1) for part in zip(*fitted, strict=True)))


def _fitted(
    points: SparsePoints, log_color: Float[np.ndarray, " observations"], views: int, *, powers: bool
) -> tuple[Float[np.ndarray, " views"], Float[np.ndarray, " views"]]:
    """Returns log gain and power of the views in one channel."""
    counts = _shared(points, log_color, views)
    used = counts[points.observed_image] & ~np.isnan(log_color)
    gain, power = np.zeros(views), np.ones(views)
    if not used.any():
        return gain, power
    by_point = np.flatnonzero(used)
    by_point = by_point[np.argsort(points.observed_point[by_point], kind="stable")]
    _, point = np.unique(points.observed_point[by_point], return_inverse=True)
    _, view = np.unique(points.observed_image[by_point], return_inverse=True)
    observed = log_color[by_point] - np.log(MIDDLE)
    gain[counts], power[counts] = _lines(point, view, observed, powers=powers)
    return gain, power


def _shared(
    points: SparsePoints, log_color: Float[np.ndarray, " observations"], views: int
) -> np.ndarray:
    """Returns which views observe enough points that others observe as well."""
    is_known = ~np.isnan(log_color)
    seen = np.bincount(points.observed_point[is_known], minlength=len(points.xyz_world))
    shared = is_known & (seen[points.observed_point] > 1)
    return np.bincount(points.observed_image[shared], minlength=views) >= LEAST_OBSERVATIONS


def _lines(
    point: Int[np.ndarray, " observations"],
    view: Int[np.ndarray, " observations"],
    observed: Float[np.ndarray, " observations"],
    *,
    powers: bool,
) -> tuple[Float[np.ndarray, " views"], Float[np.ndarray, " views"]]:
    """Returns value and slope of the views' lines, by iteratively reweighted least squares.

    Observations are in the order of their points.

    observed = color[point] + value[view] + (slope[view] - 1) color[point]; the last color is that
    of the iteration before, so each iteration is linear, and the others are eliminated from it.
    """
    n_views = int(view.max()) + 1
    weight = np.ones(len(observed))
    color = _means(point, weight, observed)
    value, slope = np.zeros(n_views), np.zeros(n_views)
    for _ in range(_ITERATIONS):
        terms = [np.ones(len(observed))] + ([color[point]] if powers else [])
        found = _solved(point, view, weight, observed, terms)
        value, slope = found[0], found[1] if powers else slope
        of_view = value[view] + slope[view] * color[point]
        color = _means(point, weight, observed - of_view)
        residual = observed - of_view - color[point]
        weight = 1 / np.sqrt(residual**2 + _SMALL**2)
    power = np.clip(1 + slope, *_POWERS)
    power /= np.median(power)
    return value - power * np.median(value / power), power


def _means(
    point: Int[np.ndarray, " observations"],
    weight: Float[np.ndarray, " observations"],
    values: Float[np.ndarray, " observations"],
) -> Float[np.ndarray, " points"]:
    return np.bincount(point, weight * values) / np.bincount(point, weight)


def _solved(
    point: Int[np.ndarray, " observations"],
    view: Int[np.ndarray, " observations"],
    weight: Float[np.ndarray, " observations"],
    observed: Float[np.ndarray, " observations"],
    terms: list[Float[np.ndarray, " observations"]],
) -> Float[np.ndarray, "terms views"]:
    """Returns the coefficients of the views' terms that fit best, each point's color eliminated."""
    n = int(view.max()) + 1
    own = [[np.diag(np.bincount(view, weight * a * b, n)) for b in terms] for a in terms]
    scaled = np.stack(terms) * weight / np.sqrt(np.bincount(point, weight))[point]
    matrix = np.block(own) - shared_products(point, view, scaled, n)
    rest = weight * (observed - _means(point, weight, observed)[point])
    right = np.concatenate([np.bincount(view, term * rest, n) for term in terms])
    ridge = np.repeat(_RIDGE[: len(terms)], n) * weight.sum() / n
    return np.linalg.solve(matrix + np.diag(ridge), right).reshape(len(terms), n)
