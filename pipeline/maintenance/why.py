"""Why a task would run: its differences from the nearest artifact in the store."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import luigi

from pipeline.canonical import Json, canonical_json
from pipeline.code.closure import code_closure, load_closure
from pipeline.errors import Errors, StoreError
from pipeline.maintenance.task_graph import stored_tasks
from pipeline.record import Action, ActionRecord
from pipeline.store import Store
from pipeline.task import StoredTask

Differences = dict[str, tuple[Json, Json]]
_KNOWN = ("up to date", "to be shown", "collected")
"""States with a known digest of the artifact, so that downstream actions are known."""
TO_BE_MADE = "to be made"
"""A placeholder for the digest of an input that does not exist yet."""


@dataclass(frozen=True, slots=True)
class Explanation:
    """A task's state, and how it differs from the nearest artifact of its family.

    Attributes:
        task: The task.
        state: "up to date", "to be shown", "collected", "the first of its family", "the first
            of its files", "cannot be made", "differs from KEY" or "waits for LABELS".
        differences: The old and new values, by path. For a task that waits, an input that does
            not exist yet counts as different.
    """

    task: StoredTask
    state: str
    differences: Differences

    @property
    def is_found(self) -> bool:
        """Returns whether nothing has to be built."""
        return self.state in _KNOWN[:2]


def explain(task: luigi.Task, store: Store) -> Iterator[dict[str, Json]]:
    """Yields the state of each task of a graph, upstream tasks first, with a row per difference."""
    for each in explanations([task], store):
        for what, (then, now) in (each.differences or {"": (None, None)}).items():
            label, state = each.task.label, each.state
            yield {"task": label, "state": state, "what": what, "then": then, "now": now}


def explanations(roots: Iterable[luigi.Task], store: Store) -> Iterator[Explanation]:
    """Yields why each task of the graphs would run, each once and upstream tasks first."""
    past = sorted(store.records(), key=lambda r: str(r.provenance["started"]), reverse=True)
    makers = {record.output.digest: str(record.provenance["label"]) for record in past}
    unknown: set[luigi.Task] = set()
    for each in stored_tasks(*roots):
        missing = {n: t for n, t in each.requires().items() if t in unknown}
        state, differences = _state(each, store, past, missing)
        unknown |= set() if state in _KNOWN else {each}
        named = {n: (_named(a, makers), _named(b, makers)) for n, (a, b) in differences.items()}
        yield Explanation(each, state, named)


def _state(
    task: StoredTask, store: Store, past: list[ActionRecord], missing: Mapping[str, StoredTask]
) -> tuple[str, Differences]:
    waits = f"waits for {', '.join(upstream.label for upstream in missing.values())}"
    family = [record for record in past if record.action.family == task.task_family]
    if missing and not family:
        return waits, {}
    repairable: Errors = (StoreError, OSError, *task.user_errors)
    try:
        record = None if missing else task.record()
        action = _expected_action(task, missing)
    except repairable as error:
        return (waits, {}) if missing else ("cannot be made", {str(error): (None, None)})
    if record:
        return ("up to date" if task.published() else "to be shown"), {}
    if not family:
        return "the first of its family", {}
    alike = [each for each in family if _reads_alike(each.action, action)]
    if not alike:
        return "the first of its files", {}
    nearest, differences = _nearest(task, action, alike, store)
    if missing:
        return waits, differences
    return (f"differs from {nearest.action.key[:12]}" if differences else "collected"), differences


def _expected_action(task: StoredTask, missing: Mapping[str, StoredTask]) -> Action:
    """Returns the action, with a placeholder for the digest of each missing input."""
    if not missing:
        return task.action()
    there = {n: t for n, t in task.requires().items() if n not in missing}
    digests = {n: str(record.output.digest) for n, t in there.items() if (record := t.record())}
    return task.action_with({**digests, **dict.fromkeys(missing, TO_BE_MADE)})


def _reads_alike(then: Action, now: Action) -> bool:
    """Returns whether two actions read a file of the same name, so that comparing them helps."""
    return not now.sources or bool(then.sources.keys() & now.sources.keys())


def _nearest(
    task: StoredTask, action: Action, family: list[ActionRecord], store: Store
) -> tuple[ActionRecord, Differences]:
    compared = [_differences(asdict(record.action), asdict(action)) for record in family]
    nearest = min(range(len(family)), key=lambda k: len(compared[k]))
    differences, record = compared[nearest], family[nearest]
    members = load_closure(str(record.provenance.get("closure")), store)
    if "code" in differences and members and not task.revision:
        del differences["code"]
        differences |= _differences({"code": members}, {"code": code_closure(type(task))})
    return record, differences


def _differences(then: object, now: object) -> Differences:
    """Returns where two nested values differ, by path: `parameters.settings.iterations`."""
    old, new = _leaves("", then), _leaves("", now)
    pairs = {path: (old.get(path, "absent"), new.get(path, "absent")) for path in {**old, **new}}
    return {path: p for path, p in pairs.items() if canonical_json(p[0]) != canonical_json(p[1])}


def _leaves(path: str, value: Any) -> dict[str, Json]:
    if not isinstance(value, Mapping):
        return {path.lstrip("."): value}
    parts = (_leaves(f"{path}.{name}", inner) for name, inner in value.items())
    return {leaf: inner for part in parts for leaf, inner in part.items()}


def _named(value: Json, makers: Mapping[str, str]) -> Json:
    """Returns a value; a digest is shortened, and followed by the task that made its object."""
    if not isinstance(value, str) or not re.fullmatch("[0-9a-f]{64}", value):
        return value
    return f"{value[:12]} by {makers[value]}" if value in makers else value[:12]
