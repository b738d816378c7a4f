"""The layout of a graph: arrows lead downwards, past artifacts, and say all that they have to."""

from typing import TypeAlias

from hypothesis import given
from hypothesis import strategies as st

from styletrf.reports.lineage.artifact import Artifact, in_topological_order, names_of_ancestors
from styletrf.reports.lineage.layout import layout


def artifact(name: str, *inputs: str, painting: str = "") -> Artifact:
    return Artifact(name, f"Stage{name}", name, "made", inputs, painting)


Row: TypeAlias = tuple[str, list[str], str]


def made(rows: list[Row]) -> list[Artifact]:
    return [artifact(name, *inputs, painting=painting) for name, inputs, painting in rows]


@st.composite
def graphs(draw: st.DrawFn) -> list[Row]:
    """Names, inputs and paintings of any artifacts without cycles, in any order."""
    count = draw(st.integers(0, 14))
    found = []
    for k in range(count):
        inputs = draw(st.sets(st.integers(0, k - 1), max_size=4)) if k else set()
        painting = draw(st.sampled_from(["", "", "p", "q"]))
        found.append((f"{k}", [f"{i}" for i in sorted(inputs)], painting))
    return draw(st.permutations(found))


@given(graphs())
def test_no_two_stand_in_one_place_and_no_arrow_crosses_an_artifact(rows: list[Row]):
    artifacts = made(rows)
    where = layout(artifacts)
    assert set(where.places) == {each.name for each in artifacts}
    assert len(set(where.places.values())) == len(artifacts)
    assert all(row < where.rows for _, row in where.places.values())
    for source, _, between in where.lines:
        assert not set(between) & set(where.places.values()), "it would pass behind one"
        others = [p for name, _, points in where.lines if name != source for p in points]
        assert not set(between) & set(others), "only arrows from one artifact run together"


@given(graphs())
def test_every_arrow_leads_downwards_one_row_at_a_time(rows: list[Row]):
    artifacts = made(rows)
    where = layout(artifacts)
    for source, target, between in where.lines:
        rows = [where.places[source][1], *(row for _, row in between), where.places[target][1]]
        assert rows == list(range(rows[0], rows[-1] + 1))
        assert len(rows) > 1


@given(graphs())
def test_arrows_say_what_everything_was_made_from_and_none_can_be_spared(rows: list[Row]):
    artifacts = made(rows)
    arrows = [(source, target) for source, target, _ in layout(artifacts).lines]
    expected = names_of_ancestors(in_topological_order(artifacts))
    assert _reached(artifacts, arrows) == expected
    for arrow in arrows:
        assert _reached(artifacts, [each for each in arrows if each != arrow]) != expected


@given(graphs(), st.randoms(use_true_random=False))
def test_the_order_of_the_artifacts_does_not_count(rows: list[Row], random):
    artifacts = made(rows)
    shuffled = artifacts[:]
    random.shuffle(shuffled)
    assert layout(shuffled) == layout(artifacts)


@given(graphs())
def test_each_painting_has_columns_of_its_own(rows: list[Row]):
    artifacts = made(rows)
    where = layout(artifacts)
    assert {group.painting for group in where.groups} >= {a.painting for a in artifacts} - {""}
    for group in where.groups:
        columns = range(group.first, group.first + group.columns)
        inside = {name for name, (column, _) in where.places.items() if column in columns}
        assert inside == {each.name for each in artifacts if each.painting == group.painting}


def test_what_is_needed_late_stands_late():
    chain = [
        artifact("a"),
        artifact("b", "a"),
        artifact("c", "b"),
        artifact("w"),
        artifact("d", "c", "w"),
    ]
    places = layout(chain).places
    assert [places[name][1] for name in "abcdw"] == [0, 1, 2, 3, 2]


def _reached(artifacts: list[Artifact], arrows: list[tuple[str, str]]) -> dict[str, frozenset[str]]:
    found = {}
    for each in in_topological_order(artifacts):
        above = [source for source, target in arrows if target == each.name]
        found[each.name] = frozenset(above).union(*(found[name] for name in above))
    return found
