"""Roots: what no collection takes. Each is a file in `roots/` that says what to keep.

A pin is a symbolic link to a record of the store. For a folder outside that shows artifacts by
links into the store, JSON tells where it is and what it was last given to show: that counts while
the file system of the folder is not mounted.
"""

import json
import os
import uuid
from collections.abc import Callable, Iterable
from pathlib import Path

from pipeline.digest import typed_digest
from pipeline.errors import StoreError
from pipeline.locks import References, locked
from pipeline.record import ActionRecord
from pipeline.store import Store


def pin(store: Store, key: str, name: str) -> None:
    """Keep the artifact of a key, with all it was made from; a name pinned before moves to it.

    Raises:
        StoreError: When the name is none for a file.
    """
    if not name or Path(name).name != name or name.startswith("."):
        raise StoreError(f"{name!r} is no name for a pin: use letters and digits")
    record = Path("..", *store.action(key).parts[-3:])
    _write_root(store, name, lambda path: path.symlink_to(record))


def require_single(found: list[ActionRecord]) -> ActionRecord:
    """The newest of some records, which all made one object.

    Raises:
        StoreError: When they made several.
    """
    if len({record.output.digest for record in found}) > 1:
        names = (f"{r.provenance['label']} ({r.action.key[:12]})" for r in found)
        raise StoreError(f"several begin so, give more digits: {', '.join(names)}")
    return max(found, key=lambda record: str(record.provenance["started"]))


def unpin(store: Store, name: str) -> None:
    """Give up what `pin` keeps under a name, or what the folder of that name shows.

    Raises:
        StoreError: When there is no such pin or folder.
    """
    path = store.root / "roots" / (name if name in pins(store) else _name_of(Path(name)))
    if not path.is_symlink() and not path.exists():
        raise StoreError(f"{store.root} has no pin {name!r}: `pin` alone lists them")
    path.unlink()


def pins(store: Store) -> dict[str, str]:
    """The pinned keys by name."""
    return {path.name: path.readlink().stem for path in (store.root / "roots").glob("[!.]*")}


def add_folder_root(store: Store, folder: Path, targets: Iterable[Path]) -> None:
    """Keep what the links in a folder outside the store show, as long as they show it.

    Args:
        store: The store.
        folder: It has to be there.
        targets: Where its links lead, or soon will.
    """
    shows = sorted(address for target in targets for address in _addresses(store, target))
    content = {"folder": str(folder.absolute()), "device": folder.stat().st_dev, "shows": shows}
    _write_root(store, _name_of(folder), lambda path: path.write_text(json.dumps(content)))


def roots(store: Store) -> References:
    """Every root that holds anything, with the keys and digests it holds.

    Raises:
        StoreError: When a root cannot be read, so that nobody can tell what it keeps.
        OSError: When a folder cannot be looked into.
    """
    found = [(root, _held(store, root)) for root in (store.root / "roots").iterdir()]
    return [(root, addresses) for root, addresses in found if addresses]


def _held(store: Store, root: Path) -> set[str]:
    if root.is_symlink():  # to a record; before, to a folder, too
        shown = root.iterdir() if root.is_dir() else ()
        return {address for link in (root, *shown) for address in _addresses(store, link)}
    try:
        content = json.loads(root.read_bytes())
        folder, device, shows = (
            Path(content["folder"]),
            content["device"],
            set[str](content["shows"]),
        )
    except (ValueError, KeyError, TypeError) as error:
        raise StoreError(f"{root} cannot be read, so nobody can tell what it keeps") from error
    links = folder.iterdir() if folder.is_dir() else ()
    now = {address for link in links for address in _addresses(store, link)}
    place = next(path for path in (folder, *folder.parents) if path.exists())
    return now or (shows if place.stat().st_dev != device else set())


def _addresses(store: Store, link: Path) -> set[str]:
    """The key or digest, if any, of what a path leads to in the store."""
    home, place = store.root.resolve(), Path(os.path.realpath(link))
    parts = place.relative_to(home).parts if place.is_relative_to(home) else ()
    return {Path(parts[2]).stem} if len(parts) > 2 else set()


def _name_of(folder: Path) -> str:
    return f".{typed_digest('pipeline-root-v1', os.fsencode(folder.absolute()))}"


def _write_root(store: Store, name: str, write: Callable[[Path], object]) -> None:
    with locked(store.root / "gc.lock", shared=True):
        partial = store.root / "tmp" / uuid.uuid4().hex
        write(partial)
        partial.replace(store.root / "roots" / name)
