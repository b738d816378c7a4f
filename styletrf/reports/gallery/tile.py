"""A tile of the gallery: a scene in a style, its picture, measures and links, or why it is missing.

All addresses are relative to the folder above the results, and all text is escaped.
"""

import html
import json
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import quote

OUTCOME_LABELS = {
    "failed": "Failed",
    "under way": "Being made",
    "late": "Not begun in time",
    "not begun": "Not made yet",
}
"""The text for a result that was requested and not made, by the outcome."""


@dataclass(frozen=True, slots=True)
class Score:
    """A metric to sort by: `value` is the sort key, None if it is unknown; `text` is shown."""

    name: str
    value: float | int | None
    text: str
    best: str = "lowest"  # or "highest"
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Cell:
    """A scene in a style.

    Attributes:
        scene: Its name.
        style: Its name.
        has_report: Whether `SCENE/STYLE/` beside the page contains a result.
        quality: The preset of the result.
        scores: The metrics of the result.
        look: The number of the style in `SCENE/viewer.html`; 0 if it is not in it.
        has_lineage: Whether `SCENE/lineage.html` is there.
        outcome: One of `OUTCOME_LABELS`; "" if it was not requested, or if it was made.
        reason: Why it was not made.
    """

    scene: str
    style: str
    has_report: bool = False
    quality: str = ""
    scores: Sequence[Score] = ()
    look: int = 0
    has_lineage: bool = False
    outcome: str = ""
    reason: str = ""

    @property
    def is_made(self) -> bool:
        """Whether there is a page to open."""
        return self.has_report or self.look > 0


def tile(cell: Cell) -> str:
    """Returns the tile as an item of a list."""
    values = {score.name: score.value for score in cell.scores if score.value is not None}
    names = f'data-scene="{html.escape(cell.scene)}" data-style="{html.escape(cell.style)}"'
    kind = f"{'made' if cell.is_made else 'missing'} {cell.outcome.replace(' ', '-')}".strip()
    body = _made(cell) if cell.is_made else f"<h2>{_name(cell)}</h2>{_problem(cell)}"
    links = _links(cell)
    inner = f'{body}<p class="links">{links}</p>' if links else body
    if cell.is_made:
        inner = f'{_picture(cell)}<div class="caption">{inner}{_scores(cell)}</div>'
    return (
        f'<li class="tile {kind}" {names} data-scores="{html.escape(json.dumps(values))}">'
        f"{inner}</li>"
    )


def _made(cell: Cell) -> str:
    folder = _folder(cell)
    page = f"{folder}/report.html" if cell.has_report else _viewer(cell)
    painting = f'<img src="{folder}/style.png" alt="" loading="lazy">' if cell.has_report else ""
    again = f'<div class="again">{_problem(cell)}</div>' if cell.outcome else ""
    return (
        f'<h2>{painting}<a href="{page}">{_name(cell)}</a> '
        f'<span class="quiet small">{html.escape(cell.quality)}</span></h2>{again}'
    )


def _picture(cell: Cell) -> str:
    folder, scene, style = _folder(cell), quote(cell.scene, safe=""), quote(cell.style, safe="")
    if not cell.has_report:
        return (
            f'<div class="picture"><img src="{scene}/viewer.{style}.jpg" alt="" loading="lazy">'
            "</div>"
        )
    return (
        f'<div class="picture"><img src="{folder}/poster.png" alt="" loading="lazy" '
        f'data-video="{folder}/video.mp4"></div>'
    )


def _scores(cell: Cell) -> str:
    rows = "".join(
        f"<dt>{html.escape(score.name)}</dt><dd>{html.escape(score.text)}</dd>"
        for score in cell.scores
    )
    return f"<dl>{rows}</dl>" if rows else ""


def _links(cell: Cell) -> str:
    name, links = _name(cell), []
    if cell.look and cell.has_report:
        links.append(f'<a href="{_viewer(cell)}" aria-label="Walk around in {name}">Viewer</a>')
    if cell.has_lineage:
        page = f"{quote(cell.scene, safe='')}/lineage.html"
        links.append(f'<a href="{page}" aria-label="Lineage of {name}">Lineage</a>')
    if cell.has_report:
        links.append(
            f'<label><input type="checkbox" class="choose" aria-label="Compare {name}">'
            "Compare</label>"
        )
    return " ".join(links)


def _problem(cell: Cell) -> str:
    label = OUTCOME_LABELS.get(cell.outcome, "")
    label += "; this is an earlier result" if cell.is_made else ""
    return f"<b>{label}</b><p>{html.escape(cell.reason)}</p>"


def _name(cell: Cell) -> str:
    return html.escape(f"{cell.scene} · {cell.style}")


def _viewer(cell: Cell) -> str:
    return f"{quote(cell.scene, safe='')}/viewer.html#style={quote(cell.style, safe='')}"


def _folder(cell: Cell) -> str:
    """Its folder as a relative URL; quoting leaves no room for a scheme or an attribute's end."""
    return f"{quote(cell.scene, safe='')}/{quote(cell.style, safe='')}"
