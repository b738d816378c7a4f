"""The exchange between a store and the shared one: records by key, objects as archives.

    objects/ab/<digest>.tar     uploaded first
    code/ab/<digest>.json       the parts of the code with this digest, for `why`
    actions/ab/<key>.json       uploaded last; if its object is lost, it still gives the digest
    grids/<name>.keys           the keys that a grid resolved, one on each line; earlier: nights/

Every object is checked: it is published like the result of a build, and only if it has the digest
in its record. Records are trusted, so whoever can write there decides the results. With a key
(`pipeline.shared_store.signatures`) only signed records count.
"""

import contextlib
import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from pipeline.artifacts import Artifacts
from pipeline.code.closure import closure_from_json, load_closure, save_closure
from pipeline.digest import is_tree
from pipeline.errors import StoreError
from pipeline.publication import commit, publish
from pipeline.record import ActionRecord
from pipeline.settings import boolean_setting
from pipeline.shared_store.archive import pack, unpack
from pipeline.shared_store.remote import Remote
from pipeline.shared_store.settings import current_remote
from pipeline.shared_store.signatures import SignatureError, from_signed_text, signed_text
from pipeline.store import Store

NEGATIVE_CACHE_S = 600.0
_log = logging.getLogger("pipeline")


@dataclass(frozen=True)
class SharedArtifacts(Artifacts):
    """The artifacts of a store, and those of the shared store behind it, if there is one."""

    def lookup(self, key: str) -> ActionRecord | None:
        """Returns the record of the key, which the store copies from the shared one if needed.

        The object may be lost in both: artifacts that were made from it need only its digest.
        """
        if record := self.store.lease_record(key):
            return record

        def download(remote: Remote) -> ActionRecord | None:
            record = _read_record(remote, key)
            return record and import_record(self.store, record, remote)

        return current_remote().call_or_none("reading", download)

    def find(self, key: str) -> ActionRecord | None:
        """Returns the record of the key if its object is available.

        If the object is lost, the record may have been replaced in the shared store: another
        machine made the artifact again with other bytes. Then this store takes that record.
        """
        record = self.lookup(key)
        if record is None or self.is_available(record):
            return record

        def download(remote: Remote) -> ActionRecord | None:
            newer = shared_record(remote, key)
            if newer is None or newer.output == record.output:
                return None
            return import_record(self.store, newer, remote, self.store.find)

        return current_remote().call_or_none("reading", download)

    def is_available(self, record: ActionRecord) -> bool:
        """Whether the record's object is intact in the store, or in the shared one."""
        if self.store.intact(record):
            return True
        with contextlib.suppress(FileNotFoundError):
            age_s = time.time() - _failure(self.store, record).stat().st_mtime
            if age_s < NEGATIVE_CACHE_S:
                return False
        return bool(current_remote().call_or_none("reading", lambda r: r.has(_object(record))))

    def fetch(self, record: ActionRecord) -> bool:
        """Downloads the record's object if it is missing; returns whether it is in the store now.

        Raises:
            OSError: The store's own disk fails or is full.
        """
        remote, store = current_remote(), self.store
        if store.intact(record) or not remote.url:
            return store.intact(record)
        with store.lock(record.output.digest, lambda: None):  # one process downloads for all
            answer = remote.call_or_none("reading", partial(pull, store, record))
        is_here = store.intact(record)
        if answer and not is_here:  # other processes then do not request it for a while
            _failure(store, record).touch()
        return is_here

    def upload(self, record: ActionRecord) -> None:
        """Uploads an artifact, unless [store] push is false; a failure of the remote is a warning.

        Raises:
            OSError: The store's own disk is full, so no other machine can get the artifact.
        """
        if boolean_setting("store", "push"):
            current_remote().call_or_none("writing", partial(push, self.store, record))


def import_record(
    store: Store,
    record: ActionRecord,
    remote: Remote,
    own: Callable[[str], ActionRecord | None] | None = None,
) -> ActionRecord:
    """Copies a shared record into the store, which keeps the `own` one if it has one."""
    code = str(record.provenance.get("closure", ""))
    if code and load_closure(code, store) is None:
        members = closure_from_json(remote.read(_code(code)) or b"", code)
        if members is not None:  # otherwise `why` explains less
            save_closure(members, store)
    with store.run.lease(record.action.key):
        return commit(store, record, own or store.record)


def shared_record(remote: Remote, key: str) -> ActionRecord | None:
    """Returns the shared store's record of the key, if its object exists there, too."""
    record = _read_record(remote, key)
    return record if record and remote.has(_object(record)) else None


def _read_record(remote: Remote, key: str) -> ActionRecord | None:
    """Returns the shared store's record of the key, whether its object exists or not."""
    record = _parsed(remote.read(_action(key)) or b"", remote)
    return record if record and record.action.key == key else None


def pull(store: Store, record: ActionRecord, remote: Remote) -> str:
    """Fetches a record's object into the store; returns the outcome in words.

    Damaged bytes are set aside in the shared store, if that is permitted.
    """
    if store.intact(record):
        return "is here"
    if not remote.has(_object(record)):
        return "is not there"
    with store.workspace(record.action.key) as workspace:
        remote.download(_object(record), workspace / "object.tar")
        try:
            unpack(workspace / "object.tar", workspace / "out", record.output)
            publish(store, workspace / "out", record.action, record.provenance, record.output)
        except ValueError as error:
            _log.warning("%s in %s is damaged: %s", _object(record), remote.url, error)
            remote.call_or_none("writing", lambda r: r.set_aside(_object(record)))
            return "is damaged there"
    return "fetched"


def push(store: Store, record: ActionRecord, remote: Remote) -> str:
    """Uploads an artifact that the shared store lacks; returns the outcome in words."""
    key, path = record.action.key, store.object(record.output.digest)
    if shared_record(remote, key):
        return "is there"
    if not is_tree(path, record.output):
        return "is missing or damaged here"
    store.reached("push-checked")
    with store.workspace(key) as workspace:
        if not remote.has(_object(record)):
            pack(path, workspace / "object.tar")
            store.reached("push-packed")
            remote.create(_object(record), workspace / "object.tar")
        store.reached("push-object")
        code = str(record.provenance.get("closure", ""))
        if code and load_closure(code, store) is not None:
            remote.create(_code(code), store.code(code))
        (workspace / "record.json").write_bytes(signed_text(record, remote.key))
        while not remote.create(_action(key), workspace / "record.json"):
            lost = remote.read(_action(key))
            if shared_record(remote, key):
                return "is there"
            _set_record_aside(remote, key, lost, workspace / "moved.json")
        store.reached("push-record")
    return "pushed"


def _set_record_aside(remote: Remote, key: str, lost: bytes | None, moved: Path) -> None:
    """Sets a useless record aside; puts one back that another machine uploaded meanwhile."""
    text = remote.read(remote.set_aside(_action(key)))
    if text is not None and text != lost:
        moved.write_bytes(text)
        remote.create(_action(key), moved)


def shared_records(remote: Remote) -> list[ActionRecord]:
    """Returns every valid record of the shared store."""
    return [record for text in remote.read_all("actions") if (record := _parsed(text, remote))]


def upload_key_list(store: Store, name: str, keys: Sequence[str]) -> None:
    """Uploads the list of keys that a grid made or found, so that nobody has to list all keys.

    It does nothing without a shared store. A failure is a warning.
    """
    remote = current_remote()
    if not remote.url:
        return
    try:
        with store.workspace(name) as workspace:
            file = workspace / "keys"
            file.write_text("".join(f"{key}\n" for key in keys))
            remote.call_or_none("writing", lambda r: r.create(f"grids/{name}.keys", file))
    except OSError as error:  # of the local disk
        _log.warning("the list of the grid %s was not uploaded: %s", name, error)


def listed_records(remote: Remote, name: str) -> list[ActionRecord]:
    """Returns the shared records on the list of a grid.

    Raises:
        StoreError: There is no such list.
    """
    folders = "grids", "nights"  # the second is its name in earlier versions
    lists = (remote.read(f"{folder}/{name}.keys") for folder in folders)
    keys = next((text for text in lists if text is not None), None)
    if keys is None:
        names = sorted(file for folder in folders for file in remote.names(folder))
        known = ", ".join(file.removesuffix(".keys") for file in names[-5:]) or "none"
        raise StoreError(f"{remote.url} has no list of the grid {name}; the last are: {known}")
    found = (shared_record(remote, key) for key in keys.decode("ascii", "replace").split())
    return [record for record in found if record]


def _parsed(text: bytes, remote: Remote) -> ActionRecord | None:
    """Returns the record in a text; None if it is invalid, or not signed by the remote's key."""
    try:
        return from_signed_text(text, remote.key)
    except SignatureError as error:
        remote.warn_unsigned("record", str(error))
    except ValueError:
        pass
    return None


def _failure(store: Store, record: ActionRecord) -> Path:
    return store.root / "quarantine" / f"{record.output.digest}.lost"


def _action(key: str) -> str:
    return f"actions/{key[:2]}/{key}.json"


def _code(digest: str) -> str:
    return f"code/{digest[:2]}/{digest}.json"


def _object(record: ActionRecord) -> str:
    digest = record.output.digest
    return f"objects/{digest[:2]}/{digest}.tar"
