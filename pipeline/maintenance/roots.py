"""Roots: files in `roots/` that protect artifacts from collection.

A pin is a symbolic link to a record of the store. For a folder outside that shows artifacts by
links into the store, a JSON file has its host, its path and its last links. These links count while
the folder cannot be seen: on another host, while its file system is not mounted, or for a user who
may not read it. A hidden file with a random mark, in a folder above, proves to another host that it
sees the same folder.
"""

import contextlib
import json
import os
import socket
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence, Set
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TypeAlias

from pipeline.digest import typed_digest
from pipeline.errors import StoreError
from pipeline.locks import locked
from pipeline.record import ActionRecord
from pipeline.store import Store

References: TypeAlias = list[tuple[Path, Set[str]]]
"""Files that protect artifacts from collection, each with the keys and digests it protects."""
_MARK = ".folder-mark"


@dataclass(frozen=True, slots=True)
class _FolderRoot:
    """The root of a folder that shows artifacts.

    Attributes:
        folder: Its absolute path.
        device: The number of its file system.
        shows: The keys and digests that its links showed last.
        host: The machine whose folder it is; "" in roots of earlier versions.
        mark: The `_mark_above` it; "" if there is none.
        store: The path of the store on that machine, to which the links lead.
    """

    folder: str
    device: int
    shows: Sequence[str]
    host: str = ""
    mark: str = ""
    store: str = ""


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

    Args:
        store: The store.
        name: The name of a pin, a folder that is seen here, or HOST:FOLDER for a folder of another
            host with all folders in it.

    Raises:
        StoreError: There is no such pin or folder, or a root cannot be read.
    """
    is_pin, held = name in pins(store), store.root / "roots"
    names = [name] if is_pin else [_name_of(Path(name)), _name_of(Path(name), _host())]
    found = {held / each for each in names if os.path.lexists(held / each)}
    if not (found := found | set(() if is_pin else _roots_of(store, name))):
        remedy = "`pin` alone lists the pins, and `gc` the machines whose folders show artifacts."
        raise StoreError(f"{store.root} has no pin {name!r}. {remedy}")
    for path in found:
        path.unlink(missing_ok=True)


def _roots_of(store: Store, name: str) -> Iterator[Path]:
    """Yields other hosts' roots of a folder seen here, or of HOST:FOLDER and the folders in it."""
    host, colon, folder = name.partition(":")
    files = (path for path in (store.root / "roots").iterdir() if not path.is_symlink())
    for path, root in ((path, _read(path)) for path in files):
        if root is None:
            continue
        is_inside = Path(root.folder).is_relative_to(folder or "/")
        is_seen = Path(root.folder) == Path(name).absolute() and _is_marked(store, root)
        if is_seen or (host and colon and root.host == host and is_inside):
            yield path


def pins(store: Store) -> dict[str, str]:
    """Returns the pinned keys by name."""
    return {path.name: path.readlink().stem for path in (store.root / "roots").glob("[!.]*")}


def add_folder_root(
    store: Store, folder: Path, targets: Iterable[Path], top: Path | None = None
) -> None:
    """Keeps the artifacts that the links in a folder outside the store show.

    Args:
        store: The store.
        folder: The folder, which exists.
        targets: The present or later targets of its links.
        top: A folder above, which outlives the folder. It gets a hidden file, by which other
            machines find that they see the same folder.
    """
    shows = sorted(address for target in targets for address in shown_artifacts(store, target))
    mark = _marked(folder, top) if top else ""
    place, device = str(folder.absolute()), folder.stat().st_dev
    root = _FolderRoot(place, device, shows, _host(), mark, str(store.root))
    content = json.dumps(asdict(root))
    _write_root(store, _name_of(folder, _host()), lambda path: path.write_text(content))


def roots(store: Store) -> dict[str, References]:
    """Returns every root that keeps anything, by the reason, with its keys and digests.

    Raises:
        StoreError: A root cannot be read, so nobody can tell what it keeps.
    """
    found: dict[str, References] = {}
    for path in (store.root / "roots").iterdir():
        host, addresses = _held(store, path)
        if addresses:
            why = "pinned or shown" if host == _host() else f"shown on {host}"
            found.setdefault(why, []).append((path, addresses))
    return found


def _held(store: Store, path: Path) -> tuple[str, set[str]]:
    """Returns the host of a root, and the keys and digests that it keeps."""
    if path.is_symlink():  # to a record; in earlier versions also to a folder
        links = (path, *(path.iterdir() if path.is_dir() else ()))
        return _host(), {address for link in links for address in shown_artifacts(store, link)}
    if (root := _read(path)) is None:
        return _host(), set()
    shown = _shown_in(store, Path(root.folder))  # before the mark, which proves that it was there
    if shown is not None and _is_marked(store, root):
        return _host(), shown
    if root.host not in ("", _host()):
        return root.host, set(root.shows)
    is_away = shown is None or _is_away(root)
    return _host(), shown or set(root.shows if is_away else ())


def _shown_in(store: Store, folder: Path) -> set[str] | None:
    """Returns what a folder shows here; None if it cannot be read."""
    links = list[Path]()
    try:
        with os.scandir(f"{folder}/.") as entries:  # needs the right to follow its links, too
            links = [folder / entry.name for entry in entries]
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError:  # no permission, or a server does not answer
        return None
    visible = [link for link in links if link.name[0] != "."]  # hidden: left by a killed command
    return {address for link in visible for address in shown_artifacts(store, link)}


def _is_away(root: _FolderRoot) -> bool:
    """Returns whether a folder that shows nothing here may show something: it is not mounted.

    One without a host may be a folder of another host, unless it exists here.
    """
    folder = Path(root.folder)
    place = next(path for path in (folder, *folder.parents) if path.exists())
    return place.stat().st_dev != root.device or (not root.host and place != folder)


def _marked(folder: Path, top: Path) -> str:
    """Returns the mark above a folder, which `top` gets if it has none.

    Returns "" if a machine that sees `top` may not see the folder, such as one on another disk.
    """
    mark, partial = top / _MARK, top / f"{_MARK}.{uuid.uuid4().hex}"
    with contextlib.suppress(OSError):  # another process was faster, or there are no hard links
        if not mark.exists():
            partial.write_text(uuid.uuid4().hex)
            mark.hardlink_to(partial)
    partial.unlink(missing_ok=True)
    is_inside = folder.resolve().is_relative_to(top.resolve())
    return _mark_above(folder) if is_inside and folder.stat().st_dev == top.stat().st_dev else ""


def _mark_above(folder: Path) -> str:
    """Returns the mark of the nearest folder that has one, with the number of its file.

    A copy of the file has another number, so a copied folder is not the same. Returns "" if there
    is none.
    """
    for mark in (place / _MARK for place in (folder, *folder.parents)):
        with contextlib.suppress(OSError):
            return f"{mark.read_bytes().hex()} {mark.stat().st_ino}"
    return ""


def _is_marked(store: Store, root: _FolderRoot) -> bool:
    """Returns whether this host sees the folder of a root, and its links lead to this store."""
    is_seen = bool(root.mark) and _mark_above(Path(root.folder)) == root.mark
    return is_seen and Path(root.store).resolve() == store.root.resolve()


def _read(path: Path) -> _FolderRoot | None:
    """Reads the root of a folder; None if another process has removed it."""
    try:
        return _FolderRoot(**json.loads(path.read_bytes()))
    except FileNotFoundError:
        return None
    except (ValueError, TypeError) as error:
        raise StoreError(
            f"{path} cannot be read, so nobody can tell what it keeps. Delete it to keep nothing."
        ) from error


def shown_artifacts(store: Store, link: Path) -> set[str]:
    """Returns the key or digest of a link's target in the store; empty for other targets."""
    home, place = store.root.resolve(), Path(os.path.realpath(link))
    parts = place.relative_to(home).parts if place.is_relative_to(home) else ()
    return {Path(parts[2]).stem} if len(parts) > 2 else set()


def _host() -> str:
    return socket.gethostname()


def _name_of(folder: Path, *host: str) -> str:
    """Returns the name of a folder's root; in earlier versions without the host."""
    parts = (os.fsencode(folder.absolute()), *map(os.fsencode, host))
    return f".{typed_digest('pipeline-root-v1', *parts)}"


def _write_root(store: Store, name: str, write: Callable[[Path], object]) -> None:
    with locked(store.root / "gc.lock", shared=True):
        partial = store.root / "tmp" / uuid.uuid4().hex
        write(partial)
        partial.replace(store.root / "roots" / name)
