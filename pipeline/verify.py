"""Looking over a store, or at one artifact before its use, and mending what is damaged."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.digest import is_tree, walk
from pipeline.publication import protect
from pipeline.record import ActionRecord
from pipeline.sharing import fetch, is_available, recorded
from pipeline.store import Store


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing wrong with a store.

    Attributes:
        kind: "no record", or what `damage` says of an object.
        path: The file or directory in question.
        record: The record that names the object.
    """

    kind: str
    path: Path
    record: ActionRecord | None = None


def records(store: Store) -> Iterator[ActionRecord]:
    """Every readable record, in the order of the keys."""
    for path in sorted((store.root / "actions").glob("*/*.json")):
        if record := store.record(path.stem):
            yield record


def problems(store: Store, *, deep: bool) -> Iterator[Problem]:
    """What is wrong with the store; an object that only the shared store has is not.

    Args:
        store: The store.
        deep: Read every byte; otherwise only count the files and their sizes.
    """
    for path in sorted((store.root / "actions").glob("*/*.json")):
        record = store.record(path.stem)
        if record is None:
            yield Problem("no record", path)
            continue
        kind = damage(store, record, deep=deep)
        if kind and not (kind == "missing" and is_available(store, record)):
            yield Problem(kind, store.object(record.output.digest), record)


def strays(store: Store) -> Iterator[Path]:
    """Objects that no record names: no damage, but what a killed process left."""
    named = {record.output.digest for record in records(store)}
    return (path for path in (store.root / "objects").glob("*/*") if path.name not in named)


def damage(store: Store, record: ActionRecord, *, deep: bool) -> str | None:
    """What is wrong with the record's object: it is "missing", "altered" or "writable"."""
    path = store.object(record.output.digest)
    if not os.path.lexists(path):
        return "missing"
    if not (is_tree(path, record.output) if deep else store.intact(record)):
        return "altered"
    modes = [path.stat().st_mode, *(status.st_mode for _, status in walk(path))]
    return "writable" if any(mode & 0o222 for mode in modes) else None


def mend(store: Store, record: ActionRecord, kind: str | None) -> bool:
    """Have the object here and as it was made, from the shared store if need be; or set aside.

    Returns:
        Whether it is so now.
    """
    path = store.object(record.output.digest)
    if kind == "writable":
        protect(path)
    elif kind == "altered":
        store.quarantine(path)
    return fetch(store, record)


def repair(store: Store, problem: Problem) -> str:
    """Mend it, or take it away so that the next run makes it anew; returns what was done."""
    if problem.record is None:
        store.quarantine(problem.path)
        is_mended = recorded(store, problem.path.stem) is not None
    else:
        is_mended = mend(store, problem.record, problem.kind)
    if is_mended:
        return "protected" if problem.kind == "writable" else "restored from the shared store"
    if problem.record:
        store.quarantine(store.action(problem.record.action.key))
    return "set aside; the next run makes it anew"
