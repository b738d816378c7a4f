"""Finds the similar photographs of a large, unordered set by the looks of their features.

Each photograph becomes one vector of locally aggregated descriptors (VLAD, Jégou et al. 2010): its
SIFT descriptors' differences from the nearest of a few visual words, summed a word, rooted and
normalized (Delhumeau et al. 2013). The words are found in the set itself, so that no other
vocabulary is needed. Neighbors in cosine are worth matching.
"""

from collections.abc import Callable

import cv2
import numpy as np
from jaxtyping import Float

from styletrf.sfm.matching.image_pairs import Pairs
from styletrf.sfm.matching.sift_features import Descriptors

VOCABULARY_SIZE = 64
_SAMPLES = 60000  # descriptors from which the words are found


def similar_pairs(
    count: int,
    descriptors_of: Callable[[int], Descriptors],
    neighbors: int,
    seed: int,
    but: Pairs | None = None,
) -> Pairs:
    """Returns pairs i < j of photographs, each with as many `neighbors` as are most like it.

    Args:
        count: The number of photographs.
        descriptors_of: Returns the SIFT descriptors of one; called twice for each.
        neighbors: The number for each; it may be a neighbor of more.
        seed: Decides the choice of samples, and the words.
        but: Pairs that are left out, for others that are less alike.
    """
    words = _words(count, descriptors_of, seed)
    vectors = np.stack([_aggregated(descriptors_of(k), words) for k in range(count)])
    likeness = vectors @ vectors.T
    np.fill_diagonal(likeness, -np.inf)
    for i, j in but or ():
        likeness[i, j] = likeness[j, i] = -np.inf
    nearest = np.argsort(-likeness, axis=1, kind="stable")[:, :neighbors]
    return sorted(
        {
            (min(i, int(j)), max(i, int(j)))
            for i in range(count)
            for j in nearest[i]
            if np.isfinite(likeness[i, j])
        }
    )


def _rooted(descriptors: Descriptors) -> Float[np.ndarray, "features 128"]:
    """Returns the roots of the descriptors divided by their sums, which have length 1.

    The descriptors are roots already (RootSIFT); a second root dampens their largest bins further.
    """
    values = descriptors.astype(np.float32)
    rooted: Float[np.ndarray, "features 128"] = np.sqrt(
        values / np.maximum(values.sum(axis=1, keepdims=True), 1e-6)
    )
    return rooted


def _words(
    count: int, descriptors_of: Callable[[int], Descriptors], seed: int
) -> Float[np.ndarray, "words 128"]:
    rng, each = np.random.default_rng(seed), max(1, _SAMPLES // count)
    parts = []
    for k in range(count):
        descriptors = descriptors_of(k)
        parts.append(_rooted(rng.permutation(descriptors)[:each]))
    samples = np.concatenate(parts)
    if len(samples) < VOCABULARY_SIZE:
        return np.zeros((1, 128), np.float32)
    cv2.setRNGSeed(seed)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 20, 1e-4)
    flags = cv2.KMEANS_PP_CENTERS
    _, _, words = cv2.kmeans(samples, VOCABULARY_SIZE, np.empty(0, np.int32), stop, 1, flags)
    return np.asarray(words)


def _aggregated(
    descriptors: Descriptors, words: Float[np.ndarray, "words 128"]
) -> Float[np.ndarray, " vector"]:
    """Returns the VLAD vector, of length 1; zeros where there are no features."""
    rooted = _rooted(descriptors)
    distances = (words**2).sum(axis=1) - 2 * rooted @ words.T
    nearest = distances.argmin(axis=1)
    sums = np.zeros_like(words)
    np.add.at(sums, nearest, rooted - words[nearest])
    sums /= np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-9)  # each word alike
    vector = sums.reshape(-1)
    rooted_vector = np.sign(vector) * np.sqrt(np.abs(vector))
    length = np.linalg.norm(rooted_vector)
    result: Float[np.ndarray, " vector"] = rooted_vector / max(float(length), 1e-9)
    return result
