"""The layout of a graph of artifacts: a row a step, a group of columns a painting.

Rows: each artifact stands directly above the first row that needs it, by the longest path down.
Groups: artifacts that paintings share stand in the first one.
Lines: an input that an input of the same artifact was made from is left out (transitive
reduction). A line over several rows passes through points of its own in the rows between, so that
it crosses no artifact; lines from one artifact share these points (Sugiyama, Tagawa, Toda 1981).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from styletrf.reports.lineage.artifact import Artifact, in_topological_order, names_of_ancestors

Point: TypeAlias = tuple[str, int]
"""A point of a line: the artifact that it comes from, and the row."""


@dataclass(frozen=True, slots=True)
class Group:
    """The columns of one painting's artifacts: `columns` in number, from `first` on."""

    painting: str
    first: int
    columns: int


@dataclass(frozen=True, slots=True)
class Layout:
    """The positions of artifacts, in columns and rows, and of the lines between them.

    Attributes:
        groups: From left to right.
        places: Column and row of each artifact.
        lines: The lines from an artifact to another: their names, and the places in the rows
            between.
        rows: The number of rows.
    """

    groups: Sequence[Group]
    places: Mapping[str, tuple[int, int]]
    lines: Sequence[tuple[str, str, Sequence[tuple[int, int]]]]
    rows: int


def layout(artifacts: Sequence[Artifact]) -> Layout:
    """Returns where artifacts stand; the same ones give the same layout, in any order."""
    ordered = in_topological_order(artifacts)
    inputs = _reduced(ordered)
    rows = _rows(ordered, inputs)
    group_of = {each.name: each.painting for each in ordered}
    points = _points(ordered, inputs, rows)
    columns = _columns(points, rows, inputs, group_of)
    groups = _groups(columns, group_of)
    first = {group.painting: group.first for group in groups}
    place = {
        point: (first[group_of[point[0]]] + column, point[1]) for point, column in columns.items()
    }
    lines = [
        (source, each.name, [place[source, r] for r in range(rows[source] + 1, rows[each.name])])
        for each in ordered
        for source in inputs[each.name]
    ]
    places = {each.name: place[each.name, rows[each.name]] for each in ordered}
    return Layout(groups, places, lines, max(rows.values(), default=-1) + 1)


def _reduced(ordered: Sequence[Artifact]) -> dict[str, list[str]]:
    """Returns the inputs of each that none of its other inputs was made from."""
    above = names_of_ancestors(ordered)
    reduced = {}
    for each in ordered:
        inputs = [name for name in dict.fromkeys(each.inputs) if name in above]
        implied = frozenset().union(*(above[name] for name in inputs))
        reduced[each.name] = sorted(name for name in inputs if name not in implied)
    return reduced


def _rows(ordered: Sequence[Artifact], inputs: Mapping[str, Sequence[str]]) -> dict[str, int]:
    """Returns each row: the first possible from above, moved down to the first that needs it."""
    rows: dict[str, int] = {}
    for each in ordered:
        rows[each.name] = max((rows[name] + 1 for name in inputs[each.name]), default=0)
    needed_at: dict[str, int] = {}
    for each in reversed(ordered):
        rows[each.name] = needed_at.get(each.name, rows[each.name] + 1) - 1
        for name in inputs[each.name]:
            needed_at[name] = min(needed_at.get(name, rows[each.name]), rows[each.name])
    return rows


def _points(
    ordered: Sequence[Artifact], inputs: Mapping[str, Sequence[str]], rows: Mapping[str, int]
) -> list[Point]:
    """Returns the positions of each artifact and of its lines, from above."""
    last = dict(rows)
    for each in ordered:
        for source in inputs[each.name]:
            last[source] = max(last[source], rows[each.name] - 1)
    found = [(name, row) for name in rows for row in range(rows[name], last[name] + 1)]
    return sorted(found, key=lambda point: point[1])


def _columns(
    points: Sequence[Point],
    rows: Mapping[str, int],
    inputs: Mapping[str, Sequence[str]],
    group_of: Mapping[str, str],
) -> dict[Point, int]:
    """Returns each point's column in its group: the free one nearest to the points above it."""
    columns: dict[Point, int] = {}
    taken: set[tuple[str, int, int]] = set()
    for row in sorted({row for _, row in points}):
        wanted: dict[Point, tuple[bool, bool, float]] = {}
        for point in (point for point in points if point[1] == row):
            name, passes = point[0], row > rows[point[0]]
            above = [name] if passes else inputs[name]
            found = [columns[p, row - 1] for p in above if group_of[p] == group_of[name]]
            best = sum(found) / len(found) if found else 0.0
            wanted[point] = (not found, passes, best)  # points with others above them come first
        for point in sorted(wanted, key=lambda p: wanted[p]):
            group, best = group_of[point[0]], wanted[point][2]
            free = (k for k in range(len(points)) if (group, row, k) not in taken)
            columns[point] = min(free, key=lambda k: (abs(k - best), k))
            taken.add((group, row, columns[point]))
    return columns


def _groups(columns: Mapping[Point, int], group_of: Mapping[str, str]) -> list[Group]:
    widths: dict[str, int] = {}
    for (name, _), column in columns.items():
        group = group_of[name]
        widths[group] = max(widths.get(group, 0), column + 1)
    groups, first = [], 0
    for painting in sorted(widths):
        groups.append(Group(painting, first, widths[painting]))
        first += widths[painting]
    return groups
