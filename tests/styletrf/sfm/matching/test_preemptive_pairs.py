"""Pairs chosen by a few features."""

from itertools import combinations

import numpy as np

from styletrf.sfm.matching.preemptive_pairs import preemptive_pairs


def descriptors(count, seed):
    values = np.random.default_rng(seed).gamma(0.3, size=(count, 128))
    return (
        np.rint(512 * values / np.linalg.norm(values, axis=1, keepdims=True))
        .clip(0, 255)
        .astype(np.uint8)
    )


def test_photographs_are_paired_with_those_of_the_same_place():
    places = [descriptors(120, seed) for seed in range(3)]
    sets = [place[k::2] if k % 2 else place[: 80 - k] for place in places for k in range(4)]
    pairs = preemptive_pairs(sets, 8)
    assert set(pairs) <= {(i, j) for i, j in combinations(range(12), 2) if i // 4 == j // 4}
    assert {i for pair in pairs for i in pair} == set(range(12))


def test_each_photograph_has_the_neighbors_that_share_most():
    """Photographs along a street, whose windows move on by ten features each."""
    street = descriptors(400, 0)
    sets = [street[10 * k : 10 * k + 100] for k in range(30)]
    pairs = preemptive_pairs(sets, 4)
    assert pairs == sorted(set(pairs))
    inner = {(i, j) for i, j in pairs if i >= 2 and j <= 27}
    assert inner == {(i, i + step) for i in range(2, 28) for step in (1, 2) if i + step <= 27}


def test_photographs_that_share_nothing_are_no_pair():
    assert preemptive_pairs([descriptors(50, seed) for seed in range(4)], 3) == []
    assert preemptive_pairs([np.empty((0, 128), np.uint8)] * 3, 3) == []


def test_pairs_that_are_left_out_give_their_place_to_others():
    street = descriptors(400, 0)
    sets = [street[10 * k : 10 * k + 100] for k in range(12)]
    beside = [(k, k + 1) for k in range(11)]
    pairs = preemptive_pairs(sets, 2, but=beside)
    assert not set(pairs) & set(beside)
    assert {(k, k + 2) for k in range(2, 8)} <= set(pairs)
