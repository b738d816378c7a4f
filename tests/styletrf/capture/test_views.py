from hypothesis import given
from hypothesis import strategies as st

from styletrf.capture.views import FEW_VIEWS, HOLD_OUT_EVERY, split_views


@given(st.integers(3, 300))
def test_a_split_holds_out_every_eighth_view_and_of_few_one_that_others_surround(n_views):
    fitted, held_out = split_views(n_views)
    assert sorted([*fitted, *held_out]) == list(range(n_views))
    if n_views < FEW_VIEWS:
        assert len(held_out) == 1
        assert 0 < held_out[0] < n_views - 1
    else:
        assert held_out == list(range(0, n_views, HOLD_OUT_EVERY))


def test_of_no_views_none_is_held_out():
    assert split_views(0) == ([], [])
