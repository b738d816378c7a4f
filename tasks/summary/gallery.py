"""`out/index.html`, the gallery: the results in `out/`, and why other requested ones failed."""

import json
import logging
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import luigi

from pipeline.maintenance.attempts import find_blocking_failure
from pipeline.settings import current_store, out_root
from styletrf.reports.gallery import Cell, Score, write_gallery
from styletrf.reports.page import duration
from tasks.summary.metric_labels import NOT_MEASURED, by_delta, term

screen = logging.getLogger("pipeline")


def refresh_gallery(root: luigi.Task | None) -> Path | None:
    """Writes the gallery and returns its path; never raises, since no result depends on it.

    Args:
        root: The requested task; each of its `cells()`, if it has any, gets a tile.
    """
    path = out_root() / "index.html"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_gallery(path, _cells(getattr(root, "cells", list)()))
    except Exception as error:  # noqa: BLE001
        screen.warning("%s could not be written: %s: %s", path, type(error).__name__, error)
        return None
    return path


def _cells(requested: Iterable[Any]) -> list[Cell]:
    cells = {(cell.scene, cell.style): cell for cell in map(_shown, _folders())}
    for task in requested:
        name, problem = (task.scene, task.style), find_blocking_failure(task, current_store())
        cells.setdefault(name, Cell(*name))
        if problem:
            family, is_under_way = problem.task.task_family, problem.is_under_way
            reason = family if is_under_way else f"{family}: {problem.reason}"
            cells[name] = replace(cells[name], failure=reason, is_under_way=is_under_way)
    return list(cells.values())


def _folders() -> list[Path]:
    """The folders of `out/` with an existing stylized trajectory."""
    found = (path.parent for path in out_root().glob("*/*/video.mp4") if path.exists())
    return [folder for folder in found if (folder / "summary.json").exists()]


def _shown(folder: Path) -> Cell:
    summary = json.loads((folder / "summary.json").read_text())  # no pyarrow, which starts threads
    quality = str(summary.get("words", {}).get("quality", ""))
    scores = _scores(summary)
    return Cell(
        folder.parent.name, folder.name, is_made=True, quality=quality, scores=scores,
        has_viewer=(folder.parent / "viewer.html").exists(),
    )  # fmt: skip


def _scores(summary: Mapping[str, Any]) -> list[Score]:
    psnr = summary["quality"].get("psnr")
    distances = [v.get("style_distance") for v in by_delta(summary).values()]
    seconds = summary.get("cost", {}).get("seconds")
    resemblance = summary.get("resemblance", {})
    return [
        _score("PSNR", psnr, "{:.2f} dB".format, "highest"),
        *(
            _score(f"{term(delta)} error", _ratio_to_floor(values), "{:.2f} x floor".format)
            for delta, values in by_delta(summary).items()
            if "error" in values
        ),
        _score("style distance", next(iter(distances), None), "{:.4f}".format),
        *(
            _score(name, resemblance.get(f"{key}_ratio"), "{:.2f} x unstylised".format)
            for name, key in _RESEMBLANCE.items()
        ),
        _score("content lost", resemblance.get("content"), "{:.2f}".format),
        _score("time, all stages", seconds, duration),
    ]


_RESEMBLANCE = {
    "patches": "style_swd_patches",
    "texture": "style_swd_texture",
    "Gram matrices": "style_gram",
}
"""Ratios of distances to the painting: stylized over unstylized frames."""


def _score(
    name: str, value: float | None, form: Callable[[float], str], best: str = "lowest"
) -> Score:
    return Score(name, value, NOT_MEASURED if value is None else form(value), best)


def _ratio_to_floor(values: Mapping[str, Any]) -> float | None:
    error, floor = values.get("error"), values.get("floor")
    return None if error is None or not floor else float(error / floor)
