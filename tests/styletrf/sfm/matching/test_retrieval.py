"""Photographs of the same things are found, whatever else is in the set."""

import numpy as np

from styletrf.sfm.matching.image_pairs import all_pairs, pairs_within
from styletrf.sfm.matching.retrieval import similar_pairs


def features(place: int, photograph: int, n: int = 300) -> np.ndarray:
    """Of a place: a share of its own 900 descriptors, a little noisy."""
    own = np.random.default_rng(place).gamma(0.5, 40, (900, 128))
    rng = np.random.default_rng([place, photograph])
    seen = own[rng.permutation(900)[:n]] + rng.normal(0, 4, (n, 128))
    return np.clip(seen, 0, 255).astype(np.uint8)


def test_neighbors_are_of_the_same_place():
    places = np.random.default_rng(0).permutation(np.repeat(np.arange(12), 5))
    sets = [features(place, k) for k, place in enumerate(places)]
    pairs = similar_pairs(60, lambda k: sets[k], 4, seed=0)
    assert len(set(pairs)) == len(pairs)
    assert all(i < j for i, j in pairs)
    same = np.mean([places[i] == places[j] for i, j in pairs])
    assert same > 0.9
    assert pairs == similar_pairs(60, lambda k: sets[k], 4, seed=0)


def test_pairs_that_are_left_out_make_room_for_others():
    """A walk past 20 places and past all of them again: what closes it is found."""
    sets = [features(k % 20, k) for k in range(40)]
    near = pairs_within([list(range(20)), list(range(20, 40))], 19)
    assert similar_pairs(40, lambda k: sets[k], 1, seed=0, but=near) == [
        (k, k + 20) for k in range(20)
    ]
    assert similar_pairs(40, lambda k: sets[k], 5, seed=0, but=all_pairs(40)) == []


def test_photographs_without_features_and_few_of_them_have_neighbors_too():
    empty = np.zeros((0, 128), np.uint8)
    assert similar_pairs(3, lambda _: empty, 5, seed=0) == [(0, 1), (0, 2), (1, 2)]
