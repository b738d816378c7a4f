"""What earlier builds took, and what is expected of the next."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.execution.cost_history import (
    Cost,
    CostSample,
    cost_history,
    cost_of_similar,
    record_cost,
)


def spent(seconds, gib=1, **parameters):
    return CostSample(parameters, Cost(seconds, gib << 30))


def test_nothing_is_expected_of_a_family_never_built(store):
    assert cost_of_similar(cost_history(store, "Word"), {"word": "a"}) is None


def test_recorded_costs_are_read_back_in_order(store):
    noted = [spent(1.5, scene="horns"), spent(3.0, scene="fern")]
    for each in noted:
        record_cost(store, "Word", each)
    assert cost_history(store, "Word") == noted


def test_the_likest_builds_count_and_of_these_the_newest():
    earlier = [spent(900, scene="horns", quality="paper")]
    earlier += [spent(k, k, scene="horns", quality="draft") for k in range(1, 8)]
    likely = cost_of_similar(earlier, {"scene": "horns", "quality": "draft"})
    assert likely == Cost(5, int(1.2 * (7 << 30))), "the newest five: median, and most memory"
    assert cost_of_similar(earlier, {"scene": "horns", "quality": "paper"}).seconds == 900


@given(st.lists(st.floats(0, 1e6), min_size=1, max_size=20))
def test_what_is_expected_lies_within_what_was(seconds):
    likely = cost_of_similar([spent(s) for s in seconds], {"word": "never met"})
    assert min(seconds) <= likely.seconds <= max(seconds)


@pytest.mark.parametrize("damage", [b'{"parameters": {"a"', b"\xff\n", b"[]\n", b'{"cost": {}}\n'])
def test_a_line_that_cannot_be_read_is_passed_over(store, damage):
    record_cost(store, "Word", spent(1))
    with (store.root / "costs" / "Word.jsonl").open("ab") as file:
        file.write(damage)
    record_cost(store, "Word", spent(2))
    record_cost(store, "Word", spent(3))
    assert {s.cost.seconds for s in cost_history(store, "Word")} >= {1, 3}


def test_a_long_history_is_read_from_its_end(store):
    for k in range(4000):
        record_cost(store, "Word", spent(k, word="x" * 60))
    found = cost_history(store, "Word")
    assert found[-1].cost.seconds == 3999
    assert 500 < len(found) < 4000


def test_a_store_that_cannot_be_written_forgets(store):
    (store.root / "costs").rmdir()
    record_cost(store, "Word", spent(1))
    assert cost_history(store, "Word") == []
