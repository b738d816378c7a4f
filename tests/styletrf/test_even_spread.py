"""Things of a sequence, evenly spread."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from styletrf.even_spread import evenly_spread


@given(st.integers(1, 300), st.integers(2, 60))
def test_spread_indices_go_from_the_first_to_the_last_in_steps_that_differ_by_one(total, count):
    chosen = evenly_spread(range(total), count)
    assert len(chosen) == min(total, count)
    assert (chosen[0], chosen[-1]) == (0, total - 1)
    steps = {b - a for a, b in pairwise(chosen)}
    assert min(steps, default=1) >= 1
    assert max(steps, default=1) - min(steps, default=1) <= 1


@given(st.lists(st.text(), max_size=5), st.integers(5, 9))
def test_few_things_are_all_there(things, count):
    assert evenly_spread(things, count) == things


def test_a_spread_of_one_is_the_first():
    assert evenly_spread("abc", 1) == ["a"]
