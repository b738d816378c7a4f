"""Matches of features against the definition, written out."""

import numba
import numpy as np
import pytest
import torch

from styletrf.sfm.matching.mutual_matches import MAX_ANGLE_RAD, MAX_RATIO, mutual_matches


def descriptors(count, seed, like=None, noise=0.1):
    """SIFT descriptors of length 512: random ones, or those of `like` with noise, shuffled."""
    rng = np.random.default_rng(seed)
    values = rng.gamma(0.3, size=(count, 128))
    if like is not None:
        shared = rng.permutation(len(like))[:count]
        values[: len(shared)] = like[shared] * (1 + noise * rng.normal(size=(len(shared), 128)))
        values = rng.permutation(values)
    values = np.abs(values) / np.linalg.norm(values, axis=1, keepdims=True)
    return np.rint(512 * values).clip(0, 255).astype(np.uint8)


def by_definition(first, other):
    """Every pair of features looked at, in exact integers."""
    if min(len(first), len(other)) == 0:
        return np.empty((0, 2), np.int64)
    products = first.astype(np.int64) @ other.astype(np.int64).T
    angles = np.arccos(np.clip((products / 512**2).astype(np.float32), 0, 1))
    pairs = []
    for i, j in enumerate(angles.argmin(axis=1)):
        rivals = [np.delete(angles[i], j), np.delete(angles[:, j], i)]
        second = min(part.min(initial=np.pi / 2) for part in rivals)
        if angles[:, j].argmin() == i and angles[i, j] <= min(MAX_ANGLE_RAD, MAX_RATIO * second):
            pairs.append((i, j))
    return np.array(pairs, np.int64).reshape(-1, 2)


@pytest.mark.parametrize(("count", "others"), [(300, (280, 1, 310)), (1, (5,)), (129, (40,) * 11)])
def test_matches_are_those_of_the_definition(count, others):
    first = descriptors(count, 0)
    sets = [descriptors(n, 1 + k, like=first) for k, n in enumerate(others)]
    found = mutual_matches(first, sets)
    assert len(found) == len(sets)
    for matches, other in zip(found, sets, strict=True):
        np.testing.assert_array_equal(matches, by_definition(first, other))
    assert sum(map(len, found)) > 0


def test_photographs_without_features_match_nothing():
    some, none = descriptors(50, 0), np.empty((0, 128), np.uint8)
    before, between, after = mutual_matches(some, [none, some, none])
    assert len(before) == len(after) == 0
    np.testing.assert_array_equal(between, by_definition(some, some))
    assert [len(found) for found in mutual_matches(none, [some, none])] == [0, 0]
    assert mutual_matches(some, []) == []


def test_a_feature_that_is_there_twice_matches_nothing():
    some = descriptors(50, 0)
    first = mutual_matches(some, [some])[0][0, 0]
    twice = np.concatenate([some, some[first : first + 1]])
    assert first not in mutual_matches(some, [twice])[0][:, 0]
    assert first not in mutual_matches(twice, [some])[0][:, 1]


@pytest.mark.usefixtures("all_cores")
def test_neither_threads_nor_company_change_the_matches():
    first = descriptors(400, 0)
    sets = [descriptors(350, k, like=first, noise=0.4) for k in range(1, 10)]
    together = mutual_matches(first, sets)
    before, kernels = torch.get_num_threads(), numba.get_num_threads()
    try:
        torch.set_num_threads(1)
        numba.set_num_threads(1)
        alone = [mutual_matches(first, [one])[0] for one in sets]
    finally:
        torch.set_num_threads(before)
        numba.set_num_threads(kernels)
    for one, other in zip(together, alone, strict=True):
        np.testing.assert_array_equal(one, other)


def test_matches_of_a_pair_are_those_of_the_swapped_pair():
    first = descriptors(300, 0)
    second = descriptors(300, 1, like=first, noise=0.4)
    (there,), (back,) = mutual_matches(first, [second]), mutual_matches(second, [first])
    assert {(i, j) for i, j in there.tolist()} == {(i, j) for j, i in back.tolist()}
