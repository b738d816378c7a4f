"""Why a task would run: what sets it apart from the nearest artifact in the store."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

import luigi

from pipeline.canonical import Json, canonical_json
from pipeline.code_identity import closure, kept
from pipeline.errors import Errors, StoreError
from pipeline.record import ActionRecord
from pipeline.store import Store
from pipeline.task import StoredTask
from pipeline.verify import records

Differences = dict[str, tuple[Json, Json]]
_KNOWN = ("up to date", "to be shown", "collected")
"""States in which the artifact's digest is known, so that what is downstream can be told."""


def explain(task: luigi.Task, store: Store) -> Iterator[dict[str, Json]]:
    """For each task of a graph, first things first: its state, and a row for every difference."""
    past = sorted(records(store), key=lambda r: str(r.provenance["started"]), reverse=True)
    makers = {record.output.digest: str(record.provenance["label"]) for record in past}
    unknown: set[luigi.Task] = set()
    for each in upstream_first(task):
        missing = [upstream.label for upstream in each.requires().values() if upstream in unknown]
        waiting = f"waits for {', '.join(missing)}"
        state, differences = (waiting, Differences()) if missing else _state(each, store, past)
        unknown |= set() if state in _KNOWN else {each}
        for what, pair in (differences or {"": (None, None)}).items():
            then, now = (_told(value, makers) for value in pair)
            yield {"task": each.label, "state": state, "what": what, "then": then, "now": now}


def upstream_first(task: luigi.Task, seen: set[luigi.Task] | None = None) -> Iterator[StoredTask]:
    """The stored tasks of a graph, each once and after all that it needs; last the task itself."""
    seen = set() if seen is None else seen
    if task not in seen:
        seen.add(task)
        for upstream in task.deps():  # type: ignore[no-untyped-call]
            yield from upstream_first(upstream, seen)
        yield from [task] if isinstance(task, StoredTask) else []


def _state(task: StoredTask, store: Store, past: list[ActionRecord]) -> tuple[str, Differences]:
    mendable: Errors = (StoreError, *task.user_errors)
    try:
        record, action = task.record(), task.action()
    except mendable as error:
        return "cannot be made", {str(error): (None, None)}
    if record:
        return ("up to date" if task.published() else "to be shown"), {}
    family = [record for record in past if record.action.family == action.family]
    if not family:
        return "the first of its family", {}
    compared = [_differences(asdict(record.action), asdict(action)) for record in family]
    nearest = min(range(len(family)), key=lambda k: len(compared[k]))
    differences, record = compared[nearest], family[nearest]
    members = kept(str(record.provenance.get("closure")), store)
    if "code" in differences and members and not task.revision:
        del differences["code"]
        differences |= _differences({"code": members}, {"code": closure(type(task))})
    return (f"differs from {record.action.key[:12]}" if differences else "collected"), differences


def _differences(then: object, now: object) -> Differences:
    """Where two nested values differ, by path: `parameters.settings.iterations`."""
    old, new = _leaves("", then), _leaves("", now)
    pairs = {path: (old.get(path, "absent"), new.get(path, "absent")) for path in {**old, **new}}
    return {path: p for path, p in pairs.items() if canonical_json(p[0]) != canonical_json(p[1])}


def _leaves(path: str, value: Any) -> dict[str, Json]:
    if not isinstance(value, Mapping):
        return {path.lstrip("."): value}
    parts = (_leaves(f"{path}.{name}", inner) for name, inner in value.items())
    return {leaf: inner for part in parts for leaf, inner in part.items()}


def _told(value: Json, makers: Mapping[str, str]) -> Json:
    """The value; a digest in short, with the task that made what it names."""
    if not isinstance(value, str) or not re.fullmatch("[0-9a-f]{64}", value):
        return value
    return f"{value[:12]} by {makers[value]}" if value in makers else value[:12]
