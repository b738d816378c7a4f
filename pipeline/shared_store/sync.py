"""What a store has from the shared one and gives to it: records by key, objects as archives.

    objects/ab/<digest>.tar     uploaded first
    code/ab/<digest>.json       what the code with this digest consists of, for `why`
    actions/ab/<key>.json       then this; without its object it counts as absent
    nights/<name>.keys          the keys that a batch resolved, a line each

Nothing from there is believed: an object comes in by the same way as a build's result, `publish`,
and only with the digest that its record tells. Who writes there decides what a record tells; with
a key (`pipeline.shared_store.signatures`) only what a holder of it wrote counts.
"""

import contextlib
import json
import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from pipeline.artifacts import Artifacts
from pipeline.code.closure import code_digest, load_closure, save_closure
from pipeline.digest import is_tree
from pipeline.errors import StoreError
from pipeline.publication import commit, publish
from pipeline.record import ActionRecord
from pipeline.settings import setting
from pipeline.shared_store.archive import pack, unpack
from pipeline.shared_store.remote import Remote
from pipeline.shared_store.settings import current_remote
from pipeline.shared_store.signatures import SignatureError, sealed, unsealed
from pipeline.store import Store

NEGATIVE_CACHE_S = 600.0
_log = logging.getLogger("pipeline")


@dataclass(frozen=True)
class SharedArtifacts(Artifacts):
    """The artifacts of a store, and those of the shared store behind it, if there is one."""

    def lookup(self, key: str) -> ActionRecord | None:
        """The record of the key: the store's, or the shared one's, which becomes the store's."""
        if record := self.store.lease_record(key):
            return record

        def download(remote: Remote) -> ActionRecord | None:
            record = shared_record(remote, key)
            return record and import_record(self.store, record, remote)

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
        with store.lock(record.output.digest, lambda: None):  # many want it, and one downloads
            remote.call_or_none("reading", partial(pull, store, record))
        is_here = store.intact(record)
        if not is_here:  # tell our other processes, lest one waits for what another cannot have
            _failure(store, record).touch()
        return is_here

    def upload(self, record: ActionRecord) -> None:
        """Uploads an artifact, unless [store] push says no; a failure over there is a warning.

        Raises:
            OSError: The store's own disk is full, so that nobody else can have the artifact.
        """
        if setting("store", "push") == "true":
            current_remote().call_or_none("writing", partial(push, self.store, record))


def import_record(store: Store, record: ActionRecord, remote: Remote) -> ActionRecord:
    """Makes a shared record the store's, which keeps its own if it has one of that key."""
    code = str(record.provenance.get("closure", ""))
    if code and load_closure(code, store) is None:
        with contextlib.suppress(ValueError, AttributeError):  # garbage: `why` then says less
            members = json.loads(remote.read(_code(code)) or b"")
            if code_digest(members) == code:
                save_closure(members, store)
    with store.run.lease(record.action.key):
        return commit(store, record, store.record)


def shared_record(remote: Remote, key: str) -> ActionRecord | None:
    """The shared store's record of the key, if its object is there, too."""
    record = _parsed(remote.read(_action(key)) or b"", remote)
    is_whole = record and record.action.key == key and remote.has(_object(record))
    return record if is_whole else None


def pull(store: Store, record: ActionRecord, remote: Remote) -> str:
    """Bring a record's object into the store; returns what came of it, in words.

    Wrong bytes are set aside over there, where that is permitted.
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
            _log.warning("%s in %s is wrong: %s", _object(record), remote.url, error)
            remote.call_or_none("writing", lambda r: r.set_aside(_object(record)))
            return "is wrong there"
    return "fetched"


def push(store: Store, record: ActionRecord, remote: Remote) -> str:
    """Upload an artifact that is not there yet; returns what came of it, in words."""
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
        (workspace / "record.json").write_bytes(sealed(record, remote.key))
        if not remote.create(_action(key), workspace / "record.json"):
            if shared_record(remote, key):
                return "is there"
            remote.set_aside(_action(key))
            remote.create(_action(key), workspace / "record.json")
        store.reached("push-record")
    return "pushed"


def shared_records(remote: Remote) -> list[ActionRecord]:
    """Every readable record of the shared store."""
    return [record for text in remote.read_all("actions") if (record := _parsed(text, remote))]


def upload_key_list(store: Store, name: str, keys: Sequence[str]) -> None:
    """Leave a list of what a batch made and found, so that nobody has to list everything.

    Nothing where there is no shared store; what fails is a warning.
    """
    if not current_remote().url:
        return
    try:
        _upload_keys(store, name, keys)
    except OSError as error:  # of our own disk
        _log.warning("the list of the night %s is not uploaded: %s", name, error)


def _upload_keys(store: Store, name: str, keys: Sequence[str]) -> None:
    with store.workspace(name) as workspace:
        at, file = f"nights/{name}.keys", workspace / "keys"
        file.write_text("".join(f"{key}\n" for key in keys))
        current_remote().call_or_none("writing", lambda remote: remote.create(at, file))


def listed_records(remote: Remote, name: str) -> list[ActionRecord]:
    """The shared records on the list of a batch.

    Raises:
        StoreError: There is no such list.
    """
    keys = remote.read(f"nights/{name}.keys")
    if keys is None:
        known = ", ".join(n.removesuffix(".keys") for n in remote.names("nights")[-5:]) or "none"
        raise StoreError(f"{remote.url} has no list of the night {name}; the last are: {known}")
    found = (shared_record(remote, key) for key in keys.decode("ascii", "replace").split())
    return [record for record in found if record]


def _parsed(text: bytes, remote: Remote) -> ActionRecord | None:
    """The record in a text; None where it is none, or not signed by the key of the remote."""
    try:
        return unsealed(text, remote.key)
    except SignatureError as error:
        remote.distrust("record", str(error))
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
