"""The commands of `python -m pipeline` that list a store. Each returns rows."""

import re
from argparse import Namespace
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TypeAlias

from pipeline.canonical import Json
from pipeline.errors import StoreError
from pipeline.maintenance.attempts import attempts
from pipeline.record import ActionRecord
from pipeline.store import Store

Rows: TypeAlias = list[dict[str, Json]]
CommandResult: TypeAlias = tuple[int, Rows]
"""An exit status, and the rows to print as a table or as JSON."""


def ls(store: Store, options: Namespace) -> CommandResult:
    """Lists artifacts or, with --failed, attempts without an artifact; oldest first."""
    everything = sorted(store.records(), key=lambda record: str(record.provenance["started"]))
    folders = [path.name for path in (store.root / "logs").iterdir()]
    known = sorted({*folders, *(record.action.family for record in everything)})
    if options.family and options.family not in known:
        problem = f"{store.root} has nothing of {options.family}"
        raise StoreError(f"{problem}. Its families are {', '.join(known)}.")
    if options.failed:
        return 0, _failures(store, options.family or "*", everything)
    return 0, [row_of(r) for r in everything if options.family in (None, r.action.family)]


def show(store: Store, options: Namespace) -> CommandResult:
    """Shows everything about the artifacts whose key or digest begins with these digits."""
    rows: Rows = []
    for record in find_all(store.records(), options.address):
        facts: dict[str, Json] = {
            "key": record.action.key,
            "object": _path_text(store.object(record.output.digest)),
            **{f"output.{name}": getattr(record.output, name) for name in ("size", "files")},
            **record.provenance,
            "log": _path_text(store.root / str(record.provenance["log"])),
            "code": record.action.code,
            "parameters": record.action.parameters,
            **{f"tool {name}": version for name, version in record.action.tools.items()},
            **{f"source {name}": digest for name, digest in record.action.sources.items()},
        }
        others = [r for r in store.records() if r.action.key != record.action.key]
        for name, digest in record.action.inputs.items():
            makers = [r for r in others if r.output.digest == digest]
            labels = ", ".join(f"{m.provenance['label']} ({m.action.key[:12]})" for m in makers)
            facts[f"input {name}"] = f"{digest[:12]} by {labels or 'nothing in this store'}"
        rows += [{"fact": name, "value": value} for name, value in facts.items()]
    return 0, rows


def du(store: Store, _options: Namespace) -> CommandResult:
    """Sums the bytes by task, then by scene. An artifact that several share is counted once."""
    objects: dict[str, list[ActionRecord]] = {}
    for record in store.records():
        if store.object(record.output.digest).is_dir():
            objects.setdefault(record.output.digest, []).append(record)
    return 0, totals(
        ({of: ", ".join(sorted({name(record) for record in makers}))}, makers[0].output.size)
        for of, name in (("family", lambda record: record.action.family), ("scene", _scene))
        for makers in objects.values()
    )


def find_all(among: Iterable[ActionRecord], address: str) -> list[ActionRecord]:
    """Returns the records whose key or digest begins with `address`.

    Raises:
        StoreError: There is no such record.
    """
    found = [
        record
        for record in among
        if any(name.startswith(address) for name in (record.action.key, record.output.digest))
    ]
    if not found:
        raise StoreError(f"no key or digest begins with {address}")
    return found


def totals(parts: Iterable[tuple[Mapping[str, str], int]]) -> Rows:
    """Returns a row for each different mapping, with its count and its bytes."""
    found: dict[tuple[tuple[str, str], ...], list[int]] = {}
    for names, size in parts:
        found.setdefault(tuple(names.items()), []).append(size)
    return [
        {**dict(names), "count": len(sizes), "size_bytes": sum(sizes)}
        for names, sizes in found.items()
    ]


def row_of(record: ActionRecord) -> dict[str, Json]:
    """Returns the row of an artifact."""
    seen = record.provenance
    return {
        "key": record.action.key,
        "started": seen["started"],
        "seconds": seen["seconds"],
        "size_bytes": record.output.size,
        "label": seen["label"],
    }


def _scene(record: ActionRecord) -> str:
    """Returns the scene of a task; "(none)" for an artifact of several scenes, such as a style."""
    return parameter_in_text(record, "scene") or "(none)"


def parameter_in_text(record: ActionRecord, name: str) -> str:
    """Returns a parameter of the task in a record, as printed; "" if the task has none.

    The text of the task has parameters that its key lacks: `StyleImage(style=NAME, quality=draft)`.
    """
    text = str(record.provenance["task"])
    found = re.search(rf"(?:\(|, ){name}=(.*?)(?:, \w+=|\)$)", text)
    return found[1] if found else ""


def _failures(store: Store, family: str, everything: Iterable[ActionRecord]) -> Rows:
    """Returns a row for each log of a build that published nothing, with its last line."""
    published = {str(record.provenance["log"]) for record in everything}
    return [
        {"state": "under way" if a.is_under_way else "ended", "log": str(a.log), "end": a.end}
        for a in attempts(store, family)
        if not a.is_published and a.log.relative_to(store.root).as_posix() not in published
    ]


def _path_text(path: Path) -> str:
    return str(path) if path.exists() else f"{path} (no longer here)"
