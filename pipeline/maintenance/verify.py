"""Finds damage in a store, and repairs it."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import StoreError
from pipeline.record import ActionRecord
from pipeline.shared_store.settings import current_remote
from pipeline.shared_store.sync import SharedArtifacts
from pipeline.store import Store


@dataclass(frozen=True, slots=True)
class Problem:
    """One damaged file or directory of a store.

    Attributes:
        kind: "no record", or the result of `Store.find_damage` for an object.
        path: The damaged file or directory.
        record: The record that names the object.
    """

    kind: str
    path: Path
    record: ActionRecord | None = None


def problems(store: Store, *, deep: bool) -> Iterator[Problem]:
    """Yields the damage of a store. An object that only the shared store has is not damaged.

    Args:
        store: The store.
        deep: Whether to read every byte, instead of only the numbers of files and bytes.
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
    """Returns the objects that no record names, which a killed process may leave."""
    named = {record.output.digest for record in store.records()}
    return (path for path in (store.root / "objects").glob("*/*") if path.name not in named)


def repair(store: Store, problem: Problem) -> str:
    """Restores the damaged part, or sets it aside for the next run; returns what was done.

    Raises:
        StoreError: The shared store does not answer, so nobody knows what it has. A valid record
            stays: its digest may be all that is left of the artifact.
    """
    artifacts, record = SharedArtifacts(store), problem.record
    if record is None:
        store.quarantine(problem.path)
        record = artifacts.lookup(problem.path.stem)
        is_repaired = record is not None and artifacts.is_available(record)
    else:
        is_repaired = artifacts.restore(record, problem.kind)
    if is_repaired:
        return "protected" if problem.kind == "writable" else "restored from the shared store"
    if record:
        if (remote := current_remote()).is_open("reading"):
            label = record.provenance["label"]
            reason = f"{remote.url} does not answer, so the record of {label} was not set aside"
            remedy = (
                "Run the same command when it answers, or without it by an empty STYLETRF_REMOTE"
            )
            raise StoreError(f"{reason}. {remedy}.")
        store.quarantine(store.action(record.action.key))
    return "set aside; the next run makes it again"
