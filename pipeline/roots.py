"""Roots: what no collection takes. `roots/NAME` is a symbolic link that says what to keep.

It leads to a record of the store (a pin), or to a folder outside that shows artifacts by links
into the store; such a root holds whatever the folder shows at the moment.
"""

import os
import uuid
from pathlib import Path

from pipeline.digest import typed_digest
from pipeline.errors import StoreError
from pipeline.leases import Holders
from pipeline.locks import locked
from pipeline.record import ActionRecord
from pipeline.store import Store


def pin(store: Store, key: str, name: str) -> None:
    """Keep the artifact of a key, with all it was made from; a name pinned before moves to it.

    Raises:
        StoreError: When the name is none for a file.
    """
    if not name or Path(name).name != name or name.startswith("."):
        raise StoreError(f"{name!r} is no name for a pin: use letters and digits")
    _link(store, name, Path("..", *store.action(key).parts[-3:]))


def only(found: list[ActionRecord]) -> ActionRecord:
    """The newest of some records, which all made one object.

    Raises:
        StoreError: When they made several.
    """
    if len({record.output.digest for record in found}) > 1:
        names = (f"{r.provenance['label']} ({r.action.key[:12]})" for r in found)
        raise StoreError(f"several begin so, give more digits: {', '.join(names)}")
    return max(found, key=lambda record: str(record.provenance["started"]))


def unpin(store: Store, name: str) -> None:
    """Give up what `pin` keeps under a name.

    Raises:
        StoreError: When there is no such pin.
    """
    if name not in pins(store):
        raise StoreError(f"{store.root} has no pin {name!r}: `pin` alone lists them")
    (store.root / "roots" / name).unlink()


def pins(store: Store) -> dict[str, str]:
    """The pinned keys by name."""
    return {path.name: path.readlink().stem for path in (store.root / "roots").glob("[!.]*")}


def show_in(store: Store, folder: Path) -> None:
    """Keep what the links in a folder outside the store show, as long as they show it."""
    name = typed_digest("pipeline-root-v1", os.fsencode(folder.absolute()))
    _link(store, f".{name}", folder.absolute())


def roots(store: Store) -> Holders:
    """Every root that holds anything, with the keys and digests it holds.

    Raises:
        OSError: When a folder cannot be looked into.
    """
    found = [(root, _addresses(store, root)) for root in (store.root / "roots").iterdir()]
    return [(root, addresses) for root, addresses in found if addresses]


def _addresses(store: Store, root: Path) -> set[str]:
    links = [root, *(root.iterdir() if root.is_dir() else ())]
    home, places = store.root.resolve(), [Path(os.path.realpath(link)) for link in links]
    inside = [place.relative_to(home).parts for place in places if place.is_relative_to(home)]
    return {Path(parts[2]).stem for parts in inside if len(parts) > 2}


def _link(store: Store, name: str, target: Path) -> None:
    with locked(store.root / "gc.lock", shared=True):
        partial = store.root / "tmp" / uuid.uuid4().hex
        partial.symlink_to(target)
        partial.replace(store.root / "roots" / name)
