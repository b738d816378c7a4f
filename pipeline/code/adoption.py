"""Takes a snapshot of the code, and declares that an edit changed no result."""

import json
from collections.abc import Iterable
from dataclasses import asdict
from datetime import UTC, datetime

from pipeline.artifact_task import ArtifactTask
from pipeline.code.atomic_write import write_atomically
from pipeline.code.closure import code_closure, code_digest
from pipeline.code.snapshot import Snapshot, identity_file
from pipeline.errors import StoreError


def snapshot_of(tasks: Iterable[type[ArtifactTask]]) -> Snapshot:
    """Returns the snapshot of the present code of some tasks."""
    now = Snapshot()
    for task in tasks:
        members = {} if task.revision else code_closure(task)
        pinned = task.revision and f"revision {task.revision}"
        now.families[str(task.task_family)] = pinned or code_digest(members)
        now.code.update({name: digest[:16] for name, digest in members.items()})
    return now


def write_snapshot(snapshot: Snapshot) -> None:
    """Replaces the file that `Snapshot.read` reads, also of builds under way."""
    text = json.dumps(asdict(snapshot), sort_keys=True, indent=1)
    write_atomically(identity_file(), f"{text}\n")


def packages(snapshot: Snapshot) -> set[str]:
    """Returns the packages that define the families of a snapshot."""
    classes = (name for name in snapshot.code if name.endswith(".__mro__"))
    return {name.partition(":")[0].split(".")[0] for name in classes}


def with_adoption(snapshot: Snapshot, family: str, code: str, reason: str) -> Snapshot:
    """Returns the snapshot with a declaration that `code` gives the same results as before.

    Raises:
        StoreError: The family's code is the same or was not known, or there is no reason.
    """
    if not reason.strip():
        raise StoreError("--reason is empty: give the reason why the results are the same")
    if family not in snapshot.families:
        raise StoreError(f"{family} is in no snapshot yet. Run `snapshot` to add it.")
    known = snapshot.families[family]
    if known == code:
        raise StoreError(f"{family}: its code is that of the snapshot. There is nothing to adopt.")
    words = {"family": family, "from": known, "to": code, "reason": reason}
    entry = {**words, "date": datetime.now(UTC).date().isoformat()}
    is_new = snapshot.original(family, code) != snapshot.original(family, known)
    families = {**snapshot.families, family: code}
    return Snapshot(families, snapshot.code, (*snapshot.adopted, *[entry] * is_new))
