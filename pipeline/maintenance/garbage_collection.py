"""Garbage collection: moves unused files to `trash/` and deletes them there.

An artifact stays if a root, a living process or one of the last runs refers to it, or if it is
recent. Everything that it was made from stays, too. While the collection finds the garbage and
moves it to `trash/`, records before their objects, no process takes a lease or publishes. The
collection deletes the files afterwards.
"""

import contextlib
import logging
import os
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from pipeline.errors import StoreError
from pipeline.locks import is_held, locked
from pipeline.maintenance.ancestors import ancestors
from pipeline.maintenance.roots import References, roots
from pipeline.record import ActionRecord
from pipeline.store import Store

_log = logging.getLogger("pipeline")
_MONTH_HOURS = 30 * 24.0
_RETENTION_RULES = (  # files, age (None: the grace period), reason; records before objects
    ("actions/*/*.json", None, "nothing uses it"),
    ("objects/*/*", None, "no kept record names it"),
    ("code/*/*.json", None, "no kept record names it"),
    ("tmp/*", None, "its process has ended"),
    ("quarantine/*", None, "it was damaged"),
    ("runs/*", None, "later runs are kept"),
    ("logs/*/*", _MONTH_HOURS, "no kept record names it"),
    ("resume/*", _MONTH_HOURS, "no build continued from it"),
    ("roots/*", _MONTH_HOURS, "its target does not exist"),
)


@dataclass(frozen=True, slots=True)
class GcDecision:
    """The decision to keep or delete a path in the store: what it is, its bytes and the reason."""

    path: Path
    what: str
    size: int
    why: str
    delete: bool


def collect(
    store: Store, *, keep_last: int = 3, grace_hours: float = 24.0, delete: bool = False
) -> list[GcDecision]:
    """Finds the garbage, and deletes it on request. Other processes may use the store.

    Args:
        store: The store. Its `gc.lock` is held until the garbage is in `trash/`.
        keep_last: The number of finished runs whose artifacts stay, 0 or more.
        grace_hours: Files that were made, used or set aside more recently stay.
        delete: Whether to delete. Otherwise the store may be read-only.

    Returns:
        Everything that is deleted, each object that stays, and the paths that other users own.

    Raises:
        StoreError: A record cannot be read, so nobody can tell what it needs.
        OSError: The disk fails. The remaining files are intact.
    """
    on_wait = partial(_log.warning, "The store is in use. The collection waits for it.")
    try:
        with locked(store.root / "gc.lock", on_wait):
            decisions = list(_decisions(store, keep_last, grace_hours))
            store.reached("marked")
            decisions = _set_aside(store, decisions) if delete else decisions
    except OSError:
        if delete:
            _empty_trash(store)
        raise
    store.reached("released")
    if delete:
        _empty_trash(store)
    return decisions


def _decisions(store: Store, keep_last: int, grace_hours: float) -> Iterator[GcDecision]:
    known = _by_address(store)
    needed = {path for path in (store.root / "tmp").iterdir() if is_held(path)}
    for why, holders in _references(store, known, keep_last, grace_hours).items():
        addresses = {address for _, held in holders for address in held}
        for record in ancestors(addresses, known):
            path = store.object(record.output.digest)
            if path not in needed:
                yield GcDecision(path, "artifacts", record.output.size, why, delete=False)
            needed |= {store.action(record.action.key), *_needs(store, record)}
        needed |= {path for path, _ in holders} | {store.object(each) for each in addresses}
    for pattern, hours, why in _RETENTION_RULES:
        for path in sorted(store.root.glob(pattern)):
            is_needed = path in needed or path.with_suffix(".log") in needed  # beside the log
            if not is_needed and not _is_younger(path, hours or grace_hours):
                maker, folder = known.get(path.name), pattern.partition("/")[0]
                what = str(maker.provenance.get("label")) if maker else folder
                yield GcDecision(path, what, size_bytes(path), why, delete=True)


def _needs(store: Store, record: ActionRecord) -> set[Path]:
    """Returns the paths of a record's object, of the code that made it, and of the log."""
    code = str(record.provenance.get("closure", record.action.code))
    log = store.root / str(record.provenance["log"])
    return {store.object(record.output.digest), store.code(code), log}


def _by_address(store: Store) -> dict[str, ActionRecord]:
    """Returns every record by its key, and the newest record of each object by its digest."""
    everything = sorted(store.records(), key=lambda record: str(record.provenance.get("started")))
    known = {record.output.digest: record for record in everything}
    known |= {record.action.key: record for record in everything}
    for path in (store.root / "actions").glob("*/*.json"):
        if path.stem not in known:
            raise StoreError(
                f"{path} cannot be read, so nobody can tell what it needs. Nothing was collected."
                " `verify --repair` sets it aside. Or collect with the newer program that wrote it."
            )
    return known


def _runs(root: Path) -> tuple[References, References]:
    """Returns the runs of living processes and the finished ones, with their keys, oldest first.

    The caller holds `gc.lock` exclusively.
    """
    living, past = References(), References()
    for path in sorted((root / "runs").glob("*.keys")):
        lines = path.read_text("utf-8", "replace").splitlines()
        keys = {line[-64:] for line in lines}  # after a full disk, two lines may be joined
        (living if is_held(path) else past).append((path, keys))
    return living, past


def _references(
    store: Store, known: Mapping[str, ActionRecord], keep_last: int, grace_hours: float
) -> dict[str, References]:
    """Returns, by reason, the paths that keep artifacts, with their keys and digests."""
    living, past = _runs(store.root)
    useful = [run for run in past if not known.keys().isdisjoint(run[1])]
    made = [(store.action(key), {key}) for key in known]
    return {
        **roots(store),
        "used by a living process": living,
        f"used by the last {keep_last} runs": useful[max(0, len(useful) - keep_last) :],
        f"made or used in the last {grace_hours:g} h": [
            (path, held) for path, held in (*past, *made) if _is_younger(path, grace_hours)
        ],
    }


def size_bytes(path: Path) -> int:
    """Returns the bytes of a file, or of the files in a directory, without deleted ones."""
    inside = [Path(folder, name) for folder, _, names in os.walk(path) for name in names]
    size = 0
    for file in inside if path.is_dir() and not path.is_symlink() else [path]:
        with contextlib.suppress(FileNotFoundError):
            size += file.lstat().st_size
    return size


def _set_aside(store: Store, decisions: Sequence[GcDecision]) -> list[GcDecision]:
    """Moves the garbage to `trash/`; returns the decisions.

    Paths that other users own stay; with a record, so do the artifacts that it needs. Records come
    first.
    """
    made, foreign, needed = list(decisions), 0, set[Path]()
    for index, decision in enumerate(decisions):
        if not decision.delete or decision.path in needed:
            made[index] = replace(decision, delete=False)
            continue
        try:
            store.set_aside(decision.path, "trash")
        except PermissionError:  # in a store of a group
            made[index] = replace(decision, why="another user owns it", delete=False)
            foreign += 1
            record = store.record(decision.path.stem)
            needed |= _needs(store, record) if record else set()
        store.reached("trashed")
    if foreign:
        text = "Paths that other users own stay: %d. Their owners, or root, can collect them."
        _log.warning(text, foreign)
    return made


def _empty_trash(store: Store) -> None:
    """Deletes the files that this collection, or one that was killed, has moved to `trash/`."""
    for path in list((store.root / "trash").iterdir()):
        _delete(path)
        store.reached("deleted")


def _delete(path: Path) -> None:
    """Deletes a file, or a directory even if parts are read-only. The next collection retries."""
    if path.is_symlink() or not path.is_dir():
        with contextlib.suppress(OSError):
            path.unlink()
        return
    for folder, _, _ in os.walk(path):
        with contextlib.suppress(OSError):
            Path(folder).chmod(0o755)
    shutil.rmtree(path, ignore_errors=True)


def _is_younger(path: Path, hours: float) -> bool:
    """Returns whether `path` was made or changed in the last `hours`; False if it is deleted."""
    try:
        return time.time() - path.lstat().st_ctime < hours * 3600
    except FileNotFoundError:
        return False
