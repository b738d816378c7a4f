import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from styletrf.image_pairs import all_pairs, is_sequence, pairs_with, sequence_pairs

counts = st.integers(0, 120)


@pytest.mark.parametrize(
    ("names", "sequence"),
    [
        ([f"frame_{i:05d}" for i in range(0, 900, 30)], True),
        ([f"IMG_{i}" for i in (1, 2, 3, 5, 6, 7, 20, 21)], True),
        ([f"DJI_2020022{3 + i % 2}_16{i}_{840 + i}" for i in range(9)], True),
        ([f"{i:012d}" for i in (9, 25, 30, 34, 36, 42, 49, 61, 64, 71)], False),
        (["left 1", "left 2", "right 1", "right 2"], False),
        (["door", "roof", "wall"], False),
        (["photo1", "photo1"], False),
        (["1"], False),
        ([], False),
    ],
)
def test_sequences_are_told_by_their_counter(names, sequence):
    assert is_sequence(names) is sequence


@settings(deadline=None)
@given(counts)
def test_all_pairs_are_all(count):
    pairs = all_pairs(count)
    assert len(set(pairs)) == len(pairs) == count * (count - 1) // 2
    assert all(0 <= i < j < count for i, j in pairs)


@settings(deadline=None)
@given(counts, st.integers(1, 20))
def test_sequence_pairs_are_pairs_once_each(count, overlap):
    pairs = sequence_pairs(count, overlap)
    assert len(set(pairs)) == len(pairs)
    assert set(pairs) <= set(all_pairs(count))
    assert {(i, j) for i, j in all_pairs(count) if j - i <= overlap} <= set(pairs)


def test_a_sequence_that_closes_is_matched_across_its_ends():
    """Wherever a path of 200 meets itself again, a pair joins the two places within `overlap`."""
    joined = np.zeros((200, 200), dtype=bool)
    for i, j in sequence_pairs(200, 10):
        joined[max(0, i - 10) : i + 11, max(0, j - 10) : j + 11] = True
    assert joined[np.triu_indices(200, 1)].all()
    assert len(sequence_pairs(200, 10)) < len(all_pairs(200)) / 5


@settings(deadline=None)
@given(counts, st.sets(st.integers(0, 119)))
def test_pairs_with_members_miss_only_pairs_of_others(count, members):
    left_out = set(all_pairs(count)) - set(pairs_with(count, sorted(members)))
    others = sorted(set(range(count)) - members)
    assert left_out == {(i, j) for i in others for j in others if i < j}
