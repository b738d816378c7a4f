import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from styletrf.capture.capture_file import Photograph
from styletrf.sfm.matching.image_pairs import (
    all_pairs,
    is_sequence,
    pairs_along,
    pairs_with,
    pairs_within,
    pieces,
    sequence_pairs,
    shots,
)

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
def test_sequences_are_found_by_their_counter(names, sequence):
    assert is_sequence(names) is sequence


@settings(deadline=None)
@given(counts)
def test_all_pairs_of_photographs_come_once_each(count):
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


def test_sequences_of_many_need_few_pairs():
    assert len(sequence_pairs(200, 10)) < len(all_pairs(200)) / 5


def frame(clip, shot, time_s):
    return Photograph(f"{clip} {shot} {time_s}", "", 4, 3, 1, "", clip, shot, time_s)


def test_shots_are_the_frames_between_cuts_in_time():
    order = [("a", 0, 2.0), ("b", 0, 0.0), ("a", 1, 3.0), ("a", 0, 1.0), (None, 0, None)]
    assert shots([frame(*one) for one in order]) == [[3, 0], [1], [2]]
    assert shots([]) == []


@settings(deadline=None)
@given(st.lists(st.integers(1, 30), max_size=4), st.integers(1, 10))
def test_sequences_are_matched_each_by_itself(lengths, overlap):
    order = np.random.default_rng(0).permutation(sum(lengths))
    sequences = [part.tolist() for part in np.split(order, np.cumsum(lengths)[:-1])]
    place = {index: (k, at) for k, one in enumerate(sequences) for at, index in enumerate(one)}
    along, within = pairs_along(sequences, overlap), pairs_within(sequences, overlap)
    assert len(along) == sum(len(sequence_pairs(n, overlap)) for n in lengths)
    assert set(within) <= set(along)
    for i, j in along:
        assert i < j
        assert place[i][0] == place[j][0]
    steps = {
        (i, j)
        for i, j in all_pairs(len(order))
        if place[i][0] == place[j][0] and abs(place[i][1] - place[j][1]) <= overlap
    }
    assert set(within) == steps


@settings(deadline=None)
@given(counts, st.sets(st.integers(0, 119)))
def test_pairs_with_members_miss_only_pairs_of_others(count, members):
    left_out = set(all_pairs(count)) - set(pairs_with(count, sorted(members)))
    others = sorted(set(range(count)) - members)
    assert left_out == {(i, j) for i in others for j in others if i < j}


def test_views_of_panoramas_follow_those_of_their_direction():
    views = [
        Photograph(f"{k}_{way}", "", 4, 3, 1, "", "a.mp4", 0, float(k), str(k), way)
        for k in range(3)
        for way in ("front", "up")
    ]
    assert shots(views) == [[0, 2, 4], [1, 3, 5]]


@settings(deadline=None)
@given(counts, st.data())
def test_photographs_have_one_piece_if_links_connect_them(count, data):
    every = all_pairs(count)
    links = data.draw(st.lists(st.sampled_from(every), max_size=60)) if every else []
    piece = pieces(count, links)
    assert all(piece[i] == piece[j] for i, j in links)
    connected = [{k} for k in range(count)]
    for i, j in links:
        one, other = (next(group for group in connected if k in group) for k in (i, j))
        if one is not other:
            connected.remove(other)
            one |= other
    assert piece == [min(group) for k in range(count) for group in connected if k in group]
