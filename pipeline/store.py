"""The store on disk: where its files are, and whether they are intact."""

import contextlib
import functools
import os
import shutil
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.digest import entries_below, is_tree, measure
from pipeline.errors import StoreError
from pipeline.locks import Run, is_held, locked, try_lock
from pipeline.record import ActionRecord

FORMAT = "styletrf store 1\n"
_FOLDERS = (
    *("objects", "actions", "code", "tmp", "trash", "quarantine"),
    *("locks", "runs", "roots", "resume", "logs", "costs"),
)


def nothing(_point: str) -> None:
    """Does nothing at a named point."""


@dataclass(frozen=True)
class Store:
    """A directory of artifacts by content (`objects`) and of records by key (`actions`).

    Attributes:
        root: The absolute directory.
        reached: Called with the name of each point that a publication or a collection reaches.
            Tests kill the process at these points.
    """

    root: Path
    reached: Callable[[str], None] = nothing

    @functools.cached_property
    def run(self) -> Run:
        """Returns the keys that this process uses, which no collection removes."""
        return Run(self.root)

    @classmethod
    def open(cls, root: Path) -> "Store":
        """Returns the store in `root`, which is created if there is none.

        Raises:
            StoreError: `root` cannot become a store, or a newer program wrote it.
        """
        try:
            if not root.exists() or os.access(root, os.W_OK):
                _make(root)
            found = (root / "format").read_text()
        except OSError as error:
            raise StoreError(f"{root} cannot be used as the store: {error.strerror}") from error
        if found not in (FORMAT, ""):
            raise StoreError(f"{root} is {found.strip()!r}; this program reads {FORMAT.strip()!r}")
        return cls(root)

    def object(self, digest: str) -> Path:
        """Returns the path of the artifact with this content, whether it exists or not."""
        return self.root / "objects" / digest[:2] / digest

    def action(self, key: str) -> Path:
        """Returns the path of the record of the action with this key."""
        return self.root / "actions" / key[:2] / f"{key}.json"

    def code(self, digest: str) -> Path:
        """Returns the path of the list of the parts of the code with this digest."""
        return self.root / "code" / digest[:2] / f"{digest}.json"

    @contextlib.contextmanager
    def resume(self, key: str, workspace: Path) -> Iterator[Path]:
        """Yields a directory for the checkpoints of one build, which survive if it is killed.

        If another build may use that one, the directory is in `workspace`.
        """
        path = self.root / "resume" / key
        descriptor = _opened(path)
        try:
            if not try_lock(descriptor) or not os.fstat(descriptor).st_nlink:  # not ours or removed
                path = workspace / "resume"
                path.mkdir()
            yield path
        finally:
            with contextlib.suppress(OSError):  # it contains a checkpoint
                path.rmdir()
            os.close(descriptor)

    def new_log(self, family: str, key: str) -> Path:
        """Returns a new, empty log file for another attempt at the key."""
        folder = self.root / "logs" / family
        folder.mkdir(exist_ok=True)
        for attempt in range(1, 1_000_000):
            path = folder / f"{key[:16]}.{attempt}.log"
            with contextlib.suppress(FileExistsError):
                path.touch(exist_ok=False)
                return path
        raise StoreError(f"{folder} has too many logs of {key}: delete some of them")

    def record(self, key: str) -> ActionRecord | None:
        """Returns the record of the key; None if it is absent or invalid."""
        try:
            record = ActionRecord.from_json(self.action(key).read_bytes())
        except (OSError, ValueError):
            return None
        return record if record.action.key == key else None

    def lease_record(self, key: str) -> ActionRecord | None:
        """Returns the `record`, and keeps all its artifacts while this process lives."""
        with self.run.lease(key):
            return self.record(key)

    def records(self) -> Iterator[ActionRecord]:
        """Yields every valid record, in the order of the keys."""
        for path in sorted((self.root / "actions").glob("*/*.json")):
            if record := self.record(path.stem):
                yield record

    def find(self, key: str) -> ActionRecord | None:
        """Returns the `lease_record` of the key, if its object is intact as well."""
        record = self.lease_record(key)
        return record if record and self.intact(record) else None

    def intact(self, record: ActionRecord) -> bool:
        """Whether the object has as many files and bytes as when it was published."""
        output = record.output
        with contextlib.suppress(OSError, ValueError):
            return measure(self.object(output.digest)) == (output.size, output.files)
        return False

    def find_damage(self, record: ActionRecord, *, deep: bool) -> str | None:
        """Returns the damage of an object: "missing", "altered", "writable" or None.

        Args:
            record: The record of the object.
            deep: Whether to read every byte, instead of only the numbers of files and bytes.
        """
        path = self.object(record.output.digest)
        if not os.path.lexists(path):
            return "missing"
        if not (is_tree(path, record.output) if deep else self.intact(record)):
            return "altered"
        modes = [path.stat().st_mode, *(status.st_mode for _, status in entries_below(path))]
        return "writable" if any(mode & 0o222 for mode in modes) else None

    def quarantine(self, path: Path) -> Path:
        """Moves something damaged into `quarantine/`, where nothing uses it; returns its place."""
        return self.set_aside(path, "quarantine")

    def set_aside(self, path: Path, folder: str) -> Path:
        """Moves `path` atomically into `folder`, without a new directory; returns its place."""
        aside = self.root / folder / f"{path.name[:50]}.{uuid.uuid4().hex}"
        with contextlib.suppress(FileNotFoundError):  # another process was faster
            if path.is_dir() and not (path.is_symlink() or os.access(path, os.W_OK)):
                path.chmod(0o755)  # moving a directory writes to its ".."
            path.rename(aside)
        return aside

    @contextlib.contextmanager
    def lock(self, key: str, on_wait: Callable[[], None]) -> Iterator[None]:
        """Holds the key's lock; calls `on_wait` first if another process holds it."""
        path = self.root / "locks" / key[:2] / f"{key}.lock"
        path.parent.mkdir(exist_ok=True)
        with locked(path, on_wait):
            yield

    @contextlib.contextmanager
    def workspace(self, key: str) -> Iterator[Path]:
        """Yields an empty directory on the store's file system, which is removed afterwards.

        Its flock shows that its process lives. Directories of ended processes are removed.
        """
        for path in (self.root / "tmp").glob(f"{key}-*"):
            if is_held(path) is False:
                shutil.rmtree(path, ignore_errors=True)
        with self.run.lease(key):
            fresh = self.root / "tmp" / uuid.uuid4().hex
            fresh.mkdir()  # others of a group may open it, and so see whether it is locked
            descriptor = os.open(fresh, os.O_RDONLY)
            try_lock(descriptor)
            path = fresh.rename(fresh.with_name(f"{key}-{fresh.name}"))  # visible only when locked
        try:
            yield path
        finally:
            shutil.rmtree(path, ignore_errors=True)
            os.close(descriptor)


def _opened(folder: Path) -> int:
    """Opens a directory, and makes it if needed, even while other processes remove it."""
    while True:
        folder.mkdir(exist_ok=True)
        with contextlib.suppress(FileNotFoundError):
            return os.open(folder, os.O_RDONLY)


def _make(root: Path) -> None:
    """Makes the folders of a store, with `format` before the others."""
    root.mkdir(parents=True, exist_ok=True)
    others = [p for p in root.iterdir() if p.name != "lost+found" and not p.name.startswith(".")]
    if others and not (root / "format").exists():
        raise StoreError(f"{root} is not a store and has files: name an empty folder or a new one")
    with contextlib.suppress(FileExistsError), (root / "format").open("x") as file:
        file.write(FORMAT)
    for folder in _FOLDERS:
        (root / folder).mkdir(exist_ok=True)


open_store = functools.cache(Store.open)
"""`Store.open`, called once for each root in a process."""
