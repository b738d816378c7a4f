"""Which photographs of a set show the same, by the matches of a few features (Wu 2013).

"Towards linear-time incremental structure from motion": the largest features of a photograph are
few, and found again in others. So the pairs of which many match are found in a fraction of the time
that all features take, and the pairs that only seem to match, as on a wallpaper, are left out.
"""

from collections.abc import Sequence

import numpy as np

from styletrf.sfm.matching.image_pairs import Pairs
from styletrf.sfm.matching.mutual_matches import mutual_matches
from styletrf.sfm.matching.sift_features import Descriptors

LARGEST = 512
"""How many features of a photograph stand for all."""


def preemptive_pairs(largest: Sequence[Descriptors], neighbors: int) -> Pairs:
    """Returns pairs i < j, each photograph with those that share most matches with it.

    Args:
        largest: Descriptors of the largest features of each photograph, about `LARGEST`.
        neighbors: Of each photograph at most; it may be a neighbor of more. Photographs without a
            common match are no neighbors.
    """
    count = len(largest)
    shared = np.zeros((count, count), np.int64)
    for i in range(count - 1):
        shared[i, i + 1 :] = [len(found) for found in mutual_matches(largest[i], largest[i + 1 :])]
    shared += shared.T
    nearest = np.argsort(-shared, axis=1, kind="stable")[:, :neighbors]
    return sorted(
        {(min(i, int(j)), max(i, int(j))) for i in range(count) for j in nearest[i] if shared[i, j]}
    )
