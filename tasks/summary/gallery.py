"""`out/index.html`, the gallery: the results in `out/`, and why requested ones are missing."""

import contextlib
import json
import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import luigi

from pipeline.settings import current_store, out_root
from styletrf.reports.gallery.page import write_gallery
from styletrf.reports.gallery.tile import OUTCOME_LABELS, Cell, Score
from styletrf.reports.page import duration
from tasks.command.outcomes import outcome_of_missing
from tasks.stages.linked_results import made_from
from tasks.summary.metric_labels import NOT_MEASURED, by_delta, term

_log = logging.getLogger("pipeline")
Cells = dict[tuple[str, str], Cell]
Pages = dict[str, dict[str, str]]
"""The addresses of a scene's pages by their titles, by the scene."""

PAGES = {
    "Viewer": "viewer.html",
    "Lineage": "lineage.html",
    "Before the fit": "scene-report/report.html",
    "Time and accuracy": "trade-off/report.html",
    "Exports": "export",
}
"""The pages of a scene in `out/SCENE/`, and the folder of its exports, by their titles."""


def refresh_gallery(root: luigi.Task | None) -> Path | None:
    """Writes the gallery and returns its path; never raises, since no result depends on it.

    Args:
        root: The requested task; each of its `cells()`, if it has any, gets a tile. So does each
            of the latest grid, by `out/grid.json`.
    """
    path = out_root() / "index.html"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        cells, pages = _shown(path.parent.iterdir())
        _add_grid(cells)
        _add_requested(cells, getattr(root, "cells", list)())
        write_gallery(path, _with_lineages(cells.values(), pages), pages)
    except Exception as error:  # noqa: BLE001
        _log.warning("%s could not be written: %s: %s", path, type(error).__name__, error)
        return None
    return path


def _shown(paths: Iterable[Path]) -> tuple[Cells, Pages]:
    """Returns the results and pages in the folders of scenes; what cannot be read is left out."""
    cells: Cells = {}
    pages: Pages = {}
    for scene in paths:
        with _left_out(scene):
            if not scene.is_dir():
                continue
            found = {title: file for title, file in PAGES.items() if (scene / file).exists()}
            cells |= _results(scene)
            pages |= {scene.name: found} if found else {}
    return cells, pages


def _results(scene: Path) -> Cells:
    """Returns the results of a scene: stylized trajectories, and paintings in its viewer."""
    cells: Cells = {}
    for folder in scene.iterdir():
        with _left_out(folder):
            if (folder / "video.mp4").exists() and (folder / "summary.json").exists():
                cells[scene.name, folder.name] = _result(folder)
    for look, style in enumerate(viewer_styles(scene), start=1):
        name = scene.name, style
        cells[name] = replace(cells.get(name, Cell(*name)), look=look)
    return cells


@contextlib.contextmanager
def _left_out(folder: Path) -> Iterator[None]:
    """Ends the body at its first error and logs it, so that one folder does not hide the others."""
    try:
        yield
    except Exception as error:  # noqa: BLE001
        reason = f"{type(error).__name__}: {error}"
        _log.warning("%s is left out of the gallery: %s", folder, reason)


def viewer_styles(scene: Path) -> list[str]:
    """Returns the styles in the viewer in a scene's folder in `out/`, in its order."""
    if not (scene / "viewer.html").exists():
        return []
    keys = made_from(scene / "viewer.html")
    record = current_store().record(keys[-1]) if keys else None
    parameters: Any = record.action.parameters if record else {}
    return [str(style) for style in parameters.get("styles", [])]


def _with_lineages(cells: Iterable[Cell], pages: Pages) -> list[Cell]:
    return [replace(cell, has_lineage="Lineage" in pages.get(cell.scene, {})) for cell in cells]


def _result(folder: Path) -> Cell:
    summary = json.loads((folder / "summary.json").read_text())  # no pyarrow, which starts threads
    parameters = summary.get("parameters", summary.get("words", {}))  # of earlier versions
    quality, name = str(parameters.get("quality", "")), (folder.parent.name, folder.name)
    return Cell(*name, has_report=True, quality=quality, scores=_scores(summary))


def _add_grid(cells: Cells) -> None:
    """Adds the cells that the latest grid did not make, unless they were made since."""
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        grid = json.loads((out_root() / "grid.json").read_text())
        ended = datetime.fromisoformat(grid["ended"]).timestamp()
        for each in grid["cells"]:
            name, outcome = (str(each["scene"]), str(each["style"])), str(each["outcome"])
            if outcome in OUTCOME_LABELS and not _is_newer(name, ended):
                _add(cells, name, outcome, str(each["reason"]))


def _is_newer(name: tuple[str, str], moment: float) -> bool:
    """Returns whether a result was linked after a moment."""
    report = Path(out_root(), *name, "report.html")
    with contextlib.suppress(OSError):
        return report.exists() and report.lstat().st_mtime > moment
    return False


def _add_requested(cells: Cells, requested: Iterable[Any]) -> None:
    for task in requested:
        name, found = (task.scene, task.style), outcome_of_missing(task)
        if found.stage:
            _add(cells, name, found.outcome, found.explanation)
        else:
            is_shown = name in cells and cells[name].has_report
            _add(cells, name, "" if is_shown else "not begun")


def _add(cells: Cells, name: tuple[str, str], outcome: str, reason: str = "") -> None:
    cell = cells.get(name, Cell(*name))
    cells[name] = replace(cell, outcome=outcome, reason=reason)


def _scores(summary: Mapping[str, Any]) -> list[Score]:
    psnr = summary["quality"].get("psnr")
    distances = [v.get("style_distance") for v in by_delta(summary).values()]
    seconds = summary.get("cost", {}).get("seconds")
    resemblance = summary.get("resemblance", {})
    return [
        _score("PSNR", psnr, "{:.2f} dB".format, "dB", best="highest"),
        *(
            _score(f"{term(delta)} error", _ratio_to_floor(values), "{:.2f} x floor".format)
            for delta, values in by_delta(summary).items()
            if "error" in values
        ),
        _score("style distance", next(iter(distances), None), "{:.4f}".format),
        *(
            _score(name, resemblance.get(f"{key}_ratio"), "{:.2f} x unstylized".format)
            for name, key in _RESEMBLANCE.items()
        ),
        _score("content lost", resemblance.get("content"), "{:.2f}".format),
        _score("time, all stages", seconds, duration, "s"),
    ]


_RESEMBLANCE = {
    "patches": "style_swd_patches",
    "texture": "style_swd_texture",
    "Gram matrices": "style_gram",
}
"""Ratios of distances to the painting: stylized over unstylized frames."""


def _score(
    name: str,
    value: float | None,
    form: Callable[[float], str],
    unit: str = "",
    best: str = "lowest",
) -> Score:
    return Score(name, value, NOT_MEASURED if value is None else form(value), best, unit)


def _ratio_to_floor(values: Mapping[str, Any]) -> float | None:
    error, floor = values.get("error"), values.get("floor")
    return None if error is None or not floor else float(error / floor)
