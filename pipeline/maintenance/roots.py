"""Roots: files in `roots/` that protect artifacts from collection.

A pin is a symbolic link to a record of the store. For a folder outside that shows artifacts by
links into the store, a JSON file has its path and its last links. These links count while the file
system of the folder is not mounted.
"""

import json
import os
import uuid
from collections.abc import Callable, Iterable, Set
from pathlib import Path
from typing import TypeAlias

from pipeline.digest import typed_digest
from pipeline.errors import StoreError
from pipeline.locks import locked
from pipeline.record import ActionRecord
from pipeline.store import Store

References: TypeAlias = list[tuple[Path, Set[str]]]
"""Files that protect artifacts from collection, each with the keys and digests it protects."""


def pin(store: Store, key: str, name: str) -> None:
    """Keeps the artifact of a key and everything it was made from.

    If the name is pinned already, it gets the new key.

    Raises:
        StoreError: The name cannot be the name of a file.
    """
    if not name or Path(name).name != name or name.startswith("."):
        raise StoreError(f"{name!r} cannot be the name of a pin: use letters and digits")
    record = Path("..", *store.action(key).parts[-3:])
    _write_root(store, name, lambda path: path.symlink_to(record))


def require_single(found: list[ActionRecord]) -> ActionRecord:
    """Returns the newest of some records of one object.

    Raises:
        StoreError: They made several objects.
    """
    if len({record.output.digest for record in found}) > 1:
        names = (f"{r.provenance['label']} ({r.action.key[:12]})" for r in found)
        raise StoreError(
            f"several artifacts begin with these digits. Give more digits: {', '.join(names)}"
        )
    return max(found, key=lambda record: str(record.provenance["started"]))


def unpin(store: Store, name: str) -> None:
    """Deletes a pin, or the root of a folder.

    Raises:
        StoreError: There is no such pin or folder.
    """
    path = store.root / "roots" / (name if name in pins(store) else _name_of(Path(name)))
    if not path.is_symlink() and not path.exists():
        raise StoreError(f"{store.root} has no pin {name!r}. `pin` alone lists the pins.")
    path.unlink()


def pins(store: Store) -> dict[str, str]:
    """Returns the pinned keys by name."""
    return {path.name: path.readlink().stem for path in (store.root / "roots").glob("[!.]*")}


def add_folder_root(store: Store, folder: Path, targets: Iterable[Path]) -> None:
    """Keeps the artifacts that the links in a folder outside the store show.

    Args:
        store: The store.
        folder: The folder, which exists.
        targets: The present or later targets of its links.
    """
    shows = sorted(address for target in targets for address in shown_artifacts(store, target))
    content = {"folder": str(folder.absolute()), "device": folder.stat().st_dev, "shows": shows}
    _write_root(store, _name_of(folder), lambda path: path.write_text(json.dumps(content)))


def roots(store: Store) -> References:
    """Returns every root that keeps anything, with its keys and digests.

    Raises:
        StoreError: A root cannot be read, so nobody can tell what it keeps.
        OSError: A folder cannot be listed.
    """
    found = [(root, _held(store, root)) for root in (store.root / "roots").iterdir()]
    return [(root, addresses) for root, addresses in found if addresses]


def _held(store: Store, root: Path) -> set[str]:
    if root.is_symlink():  # to a record; in earlier versions also to a folder
        shown = root.iterdir() if root.is_dir() else ()
        return {address for link in (root, *shown) for address in shown_artifacts(store, link)}
    try:
        content = json.loads(root.read_bytes())
        folder, device = Path(content["folder"]), content["device"]
        shows = set[str](content["shows"])
    except (ValueError, KeyError, TypeError) as error:
        raise StoreError(
            f"{root} cannot be read, so nobody can tell what it keeps. Delete it to keep nothing."
        ) from error
    links = folder.glob("[!.]*")  # a killed command may leave hidden ones
    now = {address for link in links for address in shown_artifacts(store, link)}
    place = next(path for path in (folder, *folder.parents) if path.exists())
    return now or (shows if place.stat().st_dev != device else set())


def shown_artifacts(store: Store, link: Path) -> set[str]:
    """Returns the key or digest of a link's target in the store; empty for other targets."""
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
