"""The gallery of results: a tile with a video for every scene and style, sortable by any metric.

The page lies above the folders of the results and links to their files by relative paths.
"""

import html
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from styletrf.reports.page import write_page

STYLE = Path(__file__).with_name("gallery.css").read_text(encoding="utf-8")
SCRIPT = Path(__file__).with_name("gallery.js").read_text(encoding="utf-8")


@dataclass(frozen=True, slots=True)
class Score:
    """A metric to sort by: `value` is the sort key, None if it is unknown; `text` is shown."""

    name: str
    value: float | int | None
    text: str
    best: str = "lowest"  # or "highest"


@dataclass(frozen=True, slots=True)
class Cell:
    """A scene in a style.

    Attributes:
        scene: Its name.
        style: Its name.
        is_made: Whether `SCENE/STYLE/` beside the page contains a result.
        quality: The preset of the result.
        scores: The metrics of the result.
        failure: Why the build, or a rebuild, failed.
        is_under_way: Whether `failure` names a stage that is being built instead.
        has_viewer: Whether `SCENE/viewer.html` is there.
    """

    scene: str
    style: str
    is_made: bool = False
    quality: str = ""
    scores: Sequence[Score] = ()
    failure: str = ""
    is_under_way: bool = False
    has_viewer: bool = False


def write_gallery(path: Path, cells: Sequence[Cell]) -> None:
    """Writes the page with a tile for every scene in every style; equal cells give equal bytes.

    A combination without a cell is shown as not made yet.
    """
    given = {(cell.scene, cell.style): cell for cell in cells}
    scenes, styles = sorted({cell.scene for cell in cells}), sorted({cell.style for cell in cells})
    every = [given.get((scene, style), Cell(scene, style)) for scene in scenes for style in styles]
    counts = f'data-scenes="{len(scenes)}" data-styles="{len(styles)}"'
    tiles = "\n".join(map(_tile, every))
    gallery = f'<ol class="gallery" {counts}>\n{tiles}\n</ol>' if every else "<p>Nothing yet.</p>"
    write_page(path, "Scenes and styles", [_header(every), gallery], STYLE, SCRIPT)


def _header(cells: Sequence[Cell]) -> str:
    failed = sum(map(_has_failed, cells))
    counts = f"{sum(cell.is_made for cell in cells)} of {len(cells)} made"
    counts += f", {failed} failed" if failed else ""
    measures = {score.name: score.best for cell in cells for score in cell.scores}
    buttons = "".join(
        f'<button type="button" data-key="{html.escape(name)}" data-best="{html.escape(best)}" '
        f'aria-pressed="{"true" if name == "scene" else "false"}">{html.escape(name)}</button>'
        for name, best in {"scene": "lowest", "style": "lowest", **measures}.items()
    )
    return (
        f'<header><div><h1>Scenes and styles</h1><p class="quiet">{counts}.</p></div></header>\n'
        '<div class="bar-of-buttons"><div class="sort" role="group" aria-label="Sort by">'
        f'<span class="quiet small">Sort by</span>{buttons}</div>'
        '<button type="button" class="play-all" aria-pressed="false">Play all</button></div>'
        '<p class="announcement" role="status"></p>'
    )


def _tile(cell: Cell) -> str:
    values = {score.name: score.value for score in cell.scores if score.value is not None}
    names = f'data-scene="{html.escape(cell.scene)}" data-style="{html.escape(cell.style)}"'
    kind = "made" if cell.is_made else "failed" if _has_failed(cell) else "missing"
    body = _made(cell) if cell.is_made else f"<h2>{_name(cell)}</h2>{_problem(cell)}"
    return (
        f'<li class="tile {kind}" {names} data-scores="{html.escape(json.dumps(values))}">'
        f"{body}</li>"
    )


def _has_failed(cell: Cell) -> bool:
    return bool(cell.failure) and not cell.is_under_way


def _made(cell: Cell) -> str:
    folder, name = _folder(cell), _name(cell)
    scores = "".join(
        f"<div><dt>{html.escape(score.name)}</dt><dd>{html.escape(score.text)}</dd></div>"
        for score in cell.scores
    )
    again = f'<div class="again">{_problem(cell)}</div>' if cell.failure else ""
    viewer = f"{quote(cell.scene, safe='')}/viewer.html"
    walk = f' <a class="small" href="{viewer}">Walk around</a>' if cell.has_viewer else ""
    return (
        f'<video src="{folder}/video.mp4" poster="{folder}/poster.png" controls muted loop '
        f'playsinline preload="none" aria-label="{name}"></video>'
        f'<div class="caption"><h2><img src="{folder}/style.png" alt="" loading="lazy">'
        f'<a href="{folder}/report.html">{name}</a> '
        f'<span class="quiet small">{html.escape(cell.quality)}</span>{walk}</h2>'
        f"{again}<dl>{scores}</dl></div>"
    )


def _problem(cell: Cell) -> str:
    if not cell.failure:
        return "<b>Not made yet</b>"
    word = "Being made" if cell.is_under_way else "Failed"
    again = f"{word} anew; this is an earlier one" if cell.is_made else word
    return f"<b>{again}</b><p>{html.escape(cell.failure)}</p>"


def _name(cell: Cell) -> str:
    return html.escape(f"{cell.scene} · {cell.style}")


def _folder(cell: Cell) -> str:
    """Its folder as a relative URL; quoting leaves no room for a scheme or an attribute's end."""
    return f"{quote(cell.scene, safe='')}/{quote(cell.style, safe='')}"
