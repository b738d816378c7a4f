"""Looks over a store for damage, and repairs it."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.record import ActionRecord
from pipeline.shared_store.sync import SharedArtifacts
from pipeline.store import Store


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing wrong with a store.

    Attributes:
        kind: "no record", or what `Store.find_damage` says of an object.
        path: The file or directory in question.
        record: The record that names the object.
    """

    kind: str
    path: Path
    record: ActionRecord | None = None


def problems(store: Store, *, deep: bool) -> Iterator[Problem]:
    """What is wrong with the store; an object that only the shared store has is not.

    Args:
        store: The store.
        deep: Read every byte; otherwise only count the files and their sizes.
    """
    artifacts = SharedArtifacts(store)
    for path in sorted((store.root / "actions").glob("*/*.json")):
        record = store.record(path.stem)
        if record is None:
            yield Problem("no record", path)
            continue
        kind = store.find_damage(record, deep=deep)
        if kind and not (kind == "missing" and artifacts.is_available(record)):
            yield Problem(kind, store.object(record.output.digest), record)


def unreferenced_objects(store: Store) -> Iterator[Path]:
    """Objects that no record names: no damage, but what a killed process left."""
    named = {record.output.digest for record in store.records()}
    return (path for path in (store.root / "objects").glob("*/*") if path.name not in named)


def repair(store: Store, problem: Problem) -> str:
    """Mend it, or take it away so that the next run makes it anew; returns what was done."""
    artifacts = SharedArtifacts(store)
    if problem.record is None:
        store.quarantine(problem.path)
        is_mended = artifacts.lookup(problem.path.stem) is not None
    else:
        is_mended = artifacts.restore(problem.record, problem.kind)
    if is_mended:
        return "protected" if problem.kind == "writable" else "restored from the shared store"
    if problem.record:
        store.quarantine(store.action(problem.record.action.key))
    return "set aside; the next run makes it anew"
