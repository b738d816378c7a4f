"""How photographs are exposed against each other, by the light of the points that they share."""

import numpy as np
from jaxtyping import Float

from styletrf.point_table import SparsePoints


def exposures(
    points: SparsePoints, log_light: Float[np.ndarray, " observations"], views: int
) -> Float[np.ndarray, " views"]:
    """Returns each view's median difference from the mean of its points' other views.

    Args:
        points: With their tracks.
        log_light: At each observation, to whatever base the result shall have; NaN does not count.
        views: How many there are; one that shares no point gets 0.
    """
    told = ~np.isnan(log_light)
    n = np.bincount(points.observed_point[told], minlength=len(points.xyz_world))
    total = np.bincount(
        points.observed_point[told], weights=log_light[told], minlength=len(points.xyz_world)
    )
    of_point = points.observed_point
    others = (total[of_point] - log_light) / np.maximum(n[of_point] - 1, 1)
    difference = np.where(told & (n[of_point] > 1), log_light - others, np.nan)
    result = np.zeros(views)
    for k in range(views):
        here = difference[(points.observed_image == k) & ~np.isnan(difference)]
        result[k] = np.median(here) if len(here) else 0.0
    return result
