"""Publication: turns a finished directory into an artifact of the store.

    hash -> fsync -> rename to objects/ -> read-only -> fsync the record -> link to actions/
                     |------------- no collection runs in this time ------------------------|

A record is written only after its object is durable, and never replaces a valid one. So at every
instant an artifact is complete and recorded, or invisible.
"""

import contextlib
import errno
import logging
import os
import uuid
from collections.abc import Callable, Mapping
from pathlib import Path

from pipeline.canonical import Json
from pipeline.digest import Tree, entries_below, is_tree, tree_digest
from pipeline.record import Action, ActionRecord
from pipeline.store import Store

_log = logging.getLogger("pipeline")


def publish(
    store: Store,
    out: Path,
    action: Action,
    provenance: Mapping[str, Json],
    expected: Tree | None = None,
) -> ActionRecord:
    """Makes the directory `out`, on the store's file system, the artifact of `action`.

    Returns:
        The valid record: the new one, or that of another process that was first with the key.

    Raises:
        ValueError: `out` has no file, a special file, or other content than `expected`.
        OSError: The disk fails or is full. Nothing became visible.
    """
    tree = tree_digest(out)
    if not tree.files:
        raise ValueError("it made no file")
    if tree != (expected or tree):
        raise ValueError(f"its bytes have the digest {tree.digest}")
    store.reached("hashed")
    for path in [out, *(path for path, _ in entries_below(out))]:
        sync(path)
    store.reached("synced")
    with store.run.lease(action.key):
        _place(store, out, tree)
        store.reached("placed")
        record = commit(store, ActionRecord(action, tree, provenance), store.find)
    store.reached("committed")
    return record


def _place(store: Store, out: Path, tree: Tree) -> None:
    """Renames `out` into the store, unless the store already has its content."""
    target = store.object(tree.digest)
    target.parent.mkdir(exist_ok=True)
    try:
        out.rename(target)
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR):
            raise
        if not is_tree(target, tree):
            store.quarantine(target)
            out.rename(target)
    store.reached("renamed")
    sync(target.parent)
    protect(target)


def commit(
    store: Store, record: ActionRecord, good: Callable[[str], ActionRecord | None]
) -> ActionRecord:
    """Links the record into place, unless a valid one exists; returns the valid record."""
    key, target = record.action.key, store.action(record.action.key)
    target.parent.mkdir(exist_ok=True)
    temporary = store.root / "tmp" / f"{key}.{uuid.uuid4().hex}.json"
    try:
        temporary.write_bytes(record.to_json())
        temporary.chmod(0o444)
        sync(temporary)
        store.reached("record-written")
        while True:
            lost = store.record(key)
            with contextlib.suppress(FileExistsError):
                target.hardlink_to(temporary)
                break
            if winner := good(key):
                return winner
            _warn_of_change(lost, record)
            _set_aside(store, target, lost)
        store.reached("linked")
        sync(target.parent)
    finally:
        temporary.unlink(missing_ok=True)
    return record


def _set_aside(store: Store, target: Path, lost: ActionRecord | None) -> None:
    """Quarantines a useless record; puts one back that another process linked meanwhile."""
    moved = store.quarantine(target)
    with contextlib.suppress(OSError, ValueError):  # it is invalid, or another was faster
        found = ActionRecord.from_json(moved.read_bytes())
        if found.action.key == target.stem and found != lost:
            target.hardlink_to(moved)


def _warn_of_change(lost: ActionRecord | None, record: ActionRecord) -> None:
    if lost and lost.output != record.output:
        _log.warning(
            "%s: the lost artifact was made again with other bytes (%s, before %s). Everything that"
            " was made from it will be made again.",
            record.provenance["label"],
            *(each.output.digest[:12] for each in (record, lost)),
        )


def sync(path: Path) -> None:
    """Flushes the bytes of a file, or the names in a directory, to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def protect(root: Path) -> None:
    """Makes everything read-only, against accidents; this does not prove integrity."""
    for path in [root, *(path for path, _ in entries_below(root))]:
        mode = 0o555 if path.is_dir() else 0o444
        if path.stat().st_mode & 0o7777 != mode:  # only its owner may change it
            path.chmod(mode)
