"""`out/SCENE/lineage.html`: all artifacts that the results of a scene were made from.

The page shows the artifacts of the pages in `out/SCENE/`, by the keys beside them, and those that
the command requested for the scene but could not make. No store is searched, so that the size of
the store does not count.
"""

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pipeline.maintenance.commands import parameter_in_text
from pipeline.maintenance.task_graph import stored_tasks
from pipeline.record import ActionRecord
from pipeline.settings import current_store, out_root
from pipeline.task import StoredTask
from styletrf.reports.lineage.artifact import Artifact, State
from styletrf.reports.lineage.page import write_lineage_page
from tasks.command.found_records import found_record
from tasks.command.outcomes import Outcome, outcome_of_missing
from tasks.stages.linked_results import LinkedStage, linked_pages, made_from

_log = logging.getLogger("pipeline")
Found = dict[str, Artifact]


def write_lineages(results: Iterable[LinkedStage]) -> None:
    """Writes the lineage of every scene of some results; never raises, as nothing depends on it.

    Args:
        results: The results that a command requested, made or not.
    """
    scenes: dict[str, list[LinkedStage]] = {}
    for result in results:
        scene = str(result.param_kwargs["scene"])
        if Path(scene).name == scene and not scene.startswith("."):  # it is one folder in `out/`
            scenes.setdefault(scene, []).append(result)
    for scene, requested in scenes.items():
        folder = out_root() / scene
        try:
            artifacts = lineage(folder, requested)
            folder.mkdir(parents=True, exist_ok=True)
            write_lineage_page(folder / "lineage.html", scene, artifacts)
        except Exception as error:  # noqa: BLE001
            _log.warning("The lineage of %s could not be written: %s", scene, error)


def lineage(folder: Path, requested: Iterable[LinkedStage]) -> list[Artifact]:
    """Returns the artifacts of the pages in a scene's folder, and those of requested results."""
    found: Found = {}
    for page in linked_pages(folder):
        _add_page(found, folder, page)
    for result in requested:
        _add_requested(found, result)
    return list(found.values())


def _add_page(found: Found, folder: Path, page: Path) -> None:
    makers: dict[str, str] = {}
    records = [current_store().record(key) for key in made_from(page)]
    for record in filter(None, records):
        inputs = [makers[d] for d in record.action.inputs.values() if d in makers]
        makers[record.output.digest] = record.action.key
        found.setdefault(record.action.key, _made(record, inputs))
    if records and (own := records[-1]):
        address = page.relative_to(folder).as_posix()
        found[own.action.key] = replace(found[own.action.key], page=address)


def _add_requested(found: Found, result: LinkedStage) -> None:
    names: dict[StoredTask, str] = {}
    for task in stored_tasks(result):
        record = found_record(task)
        names[task] = record.action.key if record else task.task_id
        inputs = [names[upstream] for upstream in task.requires().values()]
        found.setdefault(names[task], _made(record, inputs) if record else _missing(task, inputs))
    if found[names[result]].state == "not made":
        outcome = outcome_of_missing(result)
        if outcome.stage and (name := names.get(outcome.stage)):
            state = _STATES[outcome.outcome]
            found[name] = replace(found[name], state=state, reason=outcome.reason)


_STATES: Mapping[Outcome, State] = {
    "failed": "failed",
    "under way": "under way",
    "late": "not made",
}
"""States of the artifacts of stages that did not end well, by their outcomes."""


def _made(record: ActionRecord, inputs: Sequence[str]) -> Artifact:
    seen: Any = record.provenance
    is_there = current_store().object(record.output.digest).is_dir()
    return Artifact(
        name=record.action.key,
        family=record.action.family,
        label=str(seen["label"]),
        state="made" if is_there else "removed",
        inputs=inputs,
        painting=_painting(record),
        made=str(seen["started"]),
        seconds=float(seen["seconds"]),
        size_bytes=record.output.size,
        host=str(seen.get("host", "")),
    )


def _painting(record: ActionRecord) -> str:
    """Returns the name of the painting that an artifact was made of; "" if it was made of none."""
    parameters: Any = record.action.parameters
    if "style" in parameters:
        return str(parameters["style"])
    return parameter_in_text(record, "style")


def _missing(task: StoredTask, inputs: Sequence[str]) -> Artifact:
    painting = str(task.param_kwargs.get("style", ""))
    return Artifact(
        task.task_id, task.task_family, task.label, "not made", inputs, painting=painting
    )
