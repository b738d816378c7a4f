"""Finds photographs that show the same by the matches of a few features (Wu 2013).

"Towards linear-time incremental structure from motion": the largest features of a photograph are
few, and found again in others. So the pairs of which many match are found in a fraction of the time
that all features take. Pairs that only seem to match, as on a wallpaper, rank behind them. (Wu
requires a number of matches; here the neighbors with the most count.)
"""

from collections.abc import Sequence

import numpy as np

from styletrf.progress import Progress, silent
from styletrf.sfm.matching.image_pairs import Pairs
from styletrf.sfm.matching.mutual_matches import mutual_matches
from styletrf.sfm.matching.sift_features import Descriptors

N_LARGEST = 512
"""The number of features of a photograph that stand for all."""


def preemptive_pairs(
    largest: Sequence[Descriptors],
    neighbors: int,
    progress: Progress = silent,
    but: Pairs | None = None,
) -> Pairs:
    """Returns pairs i < j, each photograph with those that share the most matches with it.

    Args:
        largest: Descriptors of the largest features of each photograph, about `N_LARGEST`.
        neighbors: How many of them at most, for each photograph; it may be a neighbor of more.
            Photographs without a common match are no neighbors.
        progress: Called with the number of photographs compared with all that follow.
        but: Pairs that are left out.
    """
    count = len(largest)
    shared = np.zeros((count, count), np.int64)
    for i in range(count - 1):
        progress(i, count)
        shared[i, i + 1 :] = [len(found) for found in mutual_matches(largest[i], largest[i + 1 :])]
    for i, j in but or ():
        shared[i, j] = 0
    shared += shared.T
    progress(count, count)
    nearest = np.argsort(-shared, axis=1, kind="stable")[:, :neighbors]
    return sorted(
        {(min(i, int(j)), max(i, int(j))) for i in range(count) for j in nearest[i] if shared[i, j]}
    )
