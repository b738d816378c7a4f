"""The lineage of a scene as a page: its artifacts as a graph and as a table."""

import html
from collections.abc import Mapping, Sequence
from pathlib import Path

from styletrf.reports.lineage.artifact import Artifact, in_topological_order
from styletrf.reports.lineage.layout import Group, Layout, layout
from styletrf.reports.page import duration, megabytes, section, write_page

STYLE = Path(__file__).with_name("lineage.css").read_text(encoding="utf-8")
SCRIPT = Path(__file__).with_name("lineage.js").read_text(encoding="utf-8")
_COLUMN_PX, _ROW_PX, _TOP_PX = 172, 112, 40  # from card to card, and above the first
_CARD_PX = (158, 72)


def write_lineage_page(path: Path, scene: str, artifacts: Sequence[Artifact]) -> None:
    """Writes the page; it needs no other file, and all text is escaped.

    Args:
        path: Where to.
        scene: Its name.
        artifacts: The artifacts that were made or requested for the scene; inputs by their names.
    """
    ordered = sorted(in_topological_order(artifacts), key=lambda each: each.painting)
    sections = [_header(scene, ordered), _graph(ordered), section("Artifacts", _table(ordered))]
    write_page(path, f"Lineage of {scene}", sections, STYLE, SCRIPT)


def _header(scene: str, artifacts: Sequence[Artifact]) -> str:
    counts = [f"{len(artifacts)} artifacts"]
    for state in ("removed", "under way", "failed", "not made"):
        if number := sum(each.state == state for each in artifacts):
            counts.append(f"{number} {state}")
    size = megabytes(sum(each.size_bytes or 0 for each in artifacts if each.state == "made"))
    seconds = duration(sum(each.seconds or 0 for each in artifacts))
    return (
        f'<header><div><h1>{html.escape(scene)} <span class="quiet">and how it was made</span></h1>'
        f'<p class="quiet">{", ".join(counts)}; {size} in the store; {seconds} of building.</p>'
        '<p class="quiet small">An arrow leads from an artifact to what was made from it. '
        "Arrows that follow from others are left out.</p></div></header>"
    )


def _graph(artifacts: Sequence[Artifact]) -> str:
    if not artifacts:
        return "<p>Nothing yet.</p>"
    where = layout(artifacts)
    number = {each.name: k for k, each in enumerate(artifacts)}
    width = _COLUMN_PX * sum(group.columns for group in where.groups)
    height = _TOP_PX + _ROW_PX * where.rows
    lines = "".join(_line(line, where, number) for line in where.lines)
    cards = "".join(_card(each, where, number[each.name]) for each in artifacts)
    return (
        '<div class="graph" role="region" aria-label="Graph of the artifacts" tabindex="0">'
        f'<div class="plane" style="width:{width}px;height:{height}px">'
        f"{''.join(map(_group, where.groups))}"
        f'<svg viewBox="0 0 {width} {height}" width="{width}" height="{height}" aria-hidden="true">'
        '<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" '
        'markerHeight="7" orient="auto"><path d="M0 0L8 4L0 8z"/></marker></defs>'
        f"{lines}</svg>{cards}</div></div>"
    )


def _group(group: Group) -> str:
    name = html.escape(group.painting) if group.painting else "for all paintings"
    left, width = _COLUMN_PX * group.first, _COLUMN_PX * group.columns
    return f'<div class="group" style="left:{left}px;width:{width}px">{name}</div>'


def _line(
    line: tuple[str, str, Sequence[tuple[int, int]]], where: Layout, number: Mapping[str, int]
) -> str:
    source, target, between = line
    x, y = _corner(where.places[source])
    path = f"M{x} {y + _CARD_PX[1]}"
    for place in (*between, where.places[target]):
        next_x, next_y = _corner(place)
        middle = (y + _CARD_PX[1] + next_y) // 2  # it leaves and arrives straight downwards
        path += f"C{x} {middle} {next_x} {middle} {next_x} {next_y}"
        path += f"V{next_y + _CARD_PX[1]}" if place != where.places[target] else ""
        x, y = next_x, next_y
    ends = f'data-from="{number[source]}" data-to="{number[target]}"'
    return f'<path d="{path}" {ends} marker-end="url(#head)"/>'


def _corner(place: tuple[int, int]) -> tuple[int, int]:
    """Returns the middle of a card's upper side."""
    return _COLUMN_PX * place[0] + _COLUMN_PX // 2, _TOP_PX + _ROW_PX * place[1]


def _card(each: Artifact, where: Layout, number: int) -> str:
    x, y = _corner(where.places[each.name])
    facts = " · ".join(filter(None, (_seconds(each), _size(each))))
    state = "" if each.state == "made" else f"<b>{each.state}</b> "
    return (
        f'<a class="artifact {each.state.replace(" ", "-")}" href="#artifact-{number}" '
        f'data-number="{number}" style="left:{x - _CARD_PX[0] // 2}px;top:{y}px" '
        f'title="{html.escape(each.reason or each.label)}">'
        f"<span>{html.escape(each.family)}</span>"
        f"<small>{facts}</small><small>{state}{_time(each, 'age')}</small></a>"
    )


def _table(artifacts: Sequence[Artifact]) -> str:
    names = ("artifact", "state", "made", "took", "size", "machine", "key")
    head = "".join(f'<th scope="col">{name}</th>' for name in names)
    rows = "".join(_row(each, number) for number, each in enumerate(artifacts))
    table = f'<table class="artifacts"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>'
    return f'<div class="card">{table}</div>' if artifacts else ""


def _row(each: Artifact, number: int) -> str:
    label = html.escape(each.label)
    label = f'<a href="{html.escape(each.page)}">{label}</a>' if each.page else label
    reason = f'<div class="quiet small">{html.escape(each.reason)}</div>' if each.reason else ""
    key = html.escape(each.name) if each.made else ""
    return (
        f'<tr id="artifact-{number}"><th scope="row">{label}{reason}</th>'
        f'<td class="{each.state.replace(" ", "-")}">{each.state}</td>'
        f"<td>{_time(each, 'date')}</td>"
        f'<td class="number">{_seconds(each)}</td><td class="number">{_size(each)}</td>'
        f'<td>{html.escape(each.host)}</td><td><code title="{key}">{key[:12]}</code></td></tr>'
    )


def _seconds(each: Artifact) -> str:
    return "" if each.seconds is None else duration(each.seconds)


def _size(each: Artifact) -> str:
    return "" if each.size_bytes is None else megabytes(each.size_bytes)


def _time(each: Artifact, kind: str) -> str:
    """Returns the date in UTC, of which the script makes an age where one is shown."""
    if not each.made:
        return ""
    moment = html.escape(each.made)
    return f'<time class="{kind}" datetime="{moment}">{moment[:16].replace("T", " ")}</time>'
