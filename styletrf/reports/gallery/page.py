"""The gallery of results: a tile for every result, and for each requested one that is missing.

The page lies above the folders of the results and links to their files by relative paths.
"""

import html
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

from styletrf.reports.gallery.tile import OUTCOME_LABELS, Cell, tile
from styletrf.reports.page import section, write_page

STYLE = Path(__file__).with_name("gallery.css").read_text(encoding="utf-8")
SCRIPT = "".join(
    Path(__file__).with_name(name).read_text(encoding="utf-8")
    for name in ("gallery.js", "gallery_playback.js", "gallery_comparison.js")
)


def write_gallery(
    path: Path, cells: Sequence[Cell], pages: Mapping[str, Mapping[str, str]] | None = None
) -> None:
    """Writes the page with a tile for every cell; equal cells give equal bytes.

    Args:
        path: The file to write.
        cells: Each scene and style at most once.
        pages: The pages of scenes: by scene, the title of each and its file in `SCENE/`.
    """
    ordered = sorted(cells, key=lambda cell: (cell.scene, cell.style))
    tiles = "\n".join(map(tile, ordered))
    gallery = (
        f'<ol class="gallery">\n{tiles}\n</ol>\n<div class="end"></div>'
        if ordered
        else "<p>Nothing yet.</p>"
    )
    sections = [_header(ordered), _controls(ordered) if ordered else "", gallery]
    sections.append(section("Scenes", _scenes(pages or {})))
    sections.append(_COMPARISON if any(cell.has_report for cell in ordered) else "")
    write_page(path, "Scenes and styles", sections, STYLE, SCRIPT)


def _header(cells: Sequence[Cell]) -> str:
    made = sum(cell.is_made for cell in cells)
    counts = [f"{made} made"]
    for outcome, label in OUTCOME_LABELS.items():
        if number := sum(cell.outcome == outcome for cell in cells):
            counts.append(f"{number} {label.lower()}")
    return (
        '<header><div><h1>Scenes and styles</h1><p class="quiet">'
        f"{', '.join(counts)}.</p></div></header>"
    )


def _controls(cells: Sequence[Cell]) -> str:
    scores = {score.name: score for cell in cells for score in cell.scores}
    names = {"scene": {cell.scene for cell in cells}, "style": {cell.style for cell in cells}}
    measures = "".join(
        f'<option value="{html.escape(name)}" data-best="{html.escape(score.best)}">'
        f"{html.escape(f'{name}, {score.unit}' if score.unit else name)}</option>"
        for name, score in scores.items()
    )
    choices = "".join(
        f'<label>{title} <select name="{key}"><option value="">all</option>'
        f"{_options(sorted(names[key]))}</select></label>"
        for key, title in (("scene", "Scene"), ("style", "Painting"))
    )
    return _CONTROLS.format(measures=measures, choices=choices)


def _options(names: Iterable[str]) -> str:
    """Options with prefixed values, since a name may be empty or look like `all`."""
    return "".join(
        f'<option value="={html.escape(name)}">{html.escape(name)}</option>' for name in names
    )


_CONTROLS = """<form class="controls" role="search" aria-label="Filter and sort">
<label class="find">Find <input type="search" name="words" placeholder="scene or painting" \
autocomplete="off"></label>
<label>Sort by <select name="key"><option value="scene">scene</option>\
<option value="style">painting</option>{measures}</select></label>
<button type="button" class="direction" aria-pressed="false">Reverse</button>
<button type="button" class="play-all" aria-pressed="false">Play all</button>
<details><summary>More filters</summary><div class="filters">{choices}
<label>State <select name="state"><option value="">all</option><option value="made">made</option>\
<option value="problem">not made</option></select></label>
<fieldset><legend>Measure</legend><select name="measure" aria-label="Measure"><option value="">any\
</option>{measures}</select>
<label>from <input type="number" name="low" step="any"></label>
<label>to <input type="number" name="high" step="any"></label></fieldset></div></details>
</form>
<p class="count quiet small" role="status"></p>"""

_COMPARISON = """<div class="chosen card" role="region" aria-label="Chosen for comparison" hidden>
<span class="names"></span><button type="button" class="open">Side by side</button>
<button type="button" class="clear">Clear</button></div>
<dialog class="comparison" aria-labelledby="comparison-title">
<div class="head"><h2 id="comparison-title">Side by side</h2>
<button type="button" class="close">Close</button></div>
<div class="pair"></div>
<div class="seeking"><button type="button" class="play">Play</button>
<input class="seek" type="range" min="0" max="1" value="0" step="any" aria-label="Time"></div>
<table><caption class="quiet small">In bold, the better of the two.</caption><thead></thead>\
<tbody></tbody></table>
</dialog>"""


def _scenes(pages: Mapping[str, Mapping[str, str]]) -> str:
    rows = "".join(
        f'<tr><th scope="row">{html.escape(scene)}</th><td>'
        + " ".join(
            f'<a href="{quote(scene, safe="")}/{quote(file)}">{html.escape(title)}</a>'
            for title, file in files.items()
        )
        + "</td></tr>"
        for scene, files in sorted(pages.items())
    )
    table = f'<table class="scenes"><tbody>{rows}</tbody></table>'
    return f'<div class="card">{table}</div>' if rows else ""
