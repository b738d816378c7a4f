"""The store on disk: where things lie, and whether what lies there may be believed."""

import contextlib
import functools
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.digest import is_tree, measure, walk
from pipeline.errors import StoreError
from pipeline.locks import Run, is_held, locked, try_lock
from pipeline.record import ActionRecord

FORMAT = "styletrf store 1\n"
_FOLDERS = (
    *("objects", "actions", "code", "tmp", "trash", "quarantine"),
    *("locks", "runs", "roots", "resume", "logs", "costs"),
)


def nothing(_point: str) -> None:
    """Do nothing at a named point."""


@dataclass(frozen=True)
class Store:
    """A directory of artifacts by content (`objects`) and of records by key (`actions`).

    Attributes:
        root: The absolute directory.
        reached: Called with the name of each point that a publication or a collection reaches;
            tests kill there.
    """

    root: Path
    reached: Callable[[str], None] = nothing

    @functools.cached_property
    def run(self) -> Run:
        """What this process uses here, which no collection takes from it."""
        return Run(self.root)

    @classmethod
    def open(cls, root: Path) -> "Store":
        """The store in `root`, made where there is none.

        Raises:
            StoreError: When `root` is no store and cannot become one, or is a newer program's.
        """
        try:
            if not root.exists() or os.access(root, os.W_OK):
                _make(root)
            found = (root / "format").read_text()
        except OSError as error:
            raise StoreError(f"{root} cannot hold the store: {error.strerror}") from error
        if found not in (FORMAT, ""):
            raise StoreError(
                f"{root} is a {found.strip()!r}; this program reads {FORMAT.strip()!r}"
            )
        return cls(root)

    def object(self, digest: str) -> Path:
        """Where the artifact with this content lies, if it does."""
        return self.root / "objects" / digest[:2] / digest

    def action(self, key: str) -> Path:
        """Where the record of the action with this key lies, if it does."""
        return self.root / "actions" / key[:2] / f"{key}.json"

    def code(self, digest: str) -> Path:
        """Where the parts of the code with this digest are listed, if they are."""
        return self.root / "code" / digest[:2] / f"{digest}.json"

    @contextlib.contextmanager
    def resume(self, key: str, workspace: Path) -> Iterator[Path]:
        """A directory for a build's checkpoints alone: the key's, which survives kills.

        Where another build has that one, it lies in `workspace`.
        """
        path = self.root / "resume" / key
        descriptor = _opened(path)
        try:
            if not try_lock(descriptor) or not os.fstat(descriptor).st_nlink:  # taken, or gone
                path = workspace / "resume"
                path.mkdir()
            yield path
        finally:
            with contextlib.suppress(OSError):  # it holds a checkpoint
                path.rmdir()
            os.close(descriptor)

    def new_log(self, family: str, key: str) -> Path:
        """A new, empty log file for one more attempt at the key."""
        folder = self.root / "logs" / family
        folder.mkdir(exist_ok=True)
        for attempt in range(1, 1_000_000):
            path = folder / f"{key[:16]}.{attempt}.log"
            with contextlib.suppress(FileExistsError):
                path.touch(exist_ok=False)
                return path
        raise StoreError(f"{folder} is full of logs of {key}")

    def record(self, key: str) -> ActionRecord | None:
        """The record of the key; what cannot be read as one counts as none."""
        try:
            record = ActionRecord.from_json(self.action(key).read_bytes())
        except (OSError, ValueError):
            return None
        return record if record.action.key == key else None

    def lease_record(self, key: str) -> ActionRecord | None:
        """`record`; what it names, and was made from, stays while this process lives."""
        with self.run.lease(key):
            return self.record(key)

    def records(self) -> Iterator[ActionRecord]:
        """Every readable record, in the order of the keys."""
        for path in sorted((self.root / "actions").glob("*/*.json")):
            if record := self.record(path.stem):
                yield record

    def find(self, key: str) -> ActionRecord | None:
        """The record of the key if the object it names is intact, too; both stay while we live."""
        record = self.lease_record(key)
        return record if record and self.intact(record) else None

    def intact(self, record: ActionRecord) -> bool:
        """Whether the object has the number of files and bytes it was published with."""
        try:
            size, files = measure(self.object(record.output.digest))
        except (OSError, ValueError):
            return False
        return (size, files) == (record.output.size, record.output.files)

    def find_damage(self, record: ActionRecord, *, deep: bool) -> str | None:
        """What is wrong with the record's object: it is "missing", "altered" or "writable".

        Args:
            record: Of the object.
            deep: Read every byte; otherwise only count the files and their sizes.
        """
        path = self.object(record.output.digest)
        if not os.path.lexists(path):
            return "missing"
        if not (is_tree(path, record.output) if deep else self.intact(record)):
            return "altered"
        modes = [path.stat().st_mode, *(status.st_mode for _, status in walk(path))]
        return "writable" if any(mode & 0o222 for mode in modes) else None

    def quarantine(self, path: Path) -> None:
        """Set something damaged aside, where nothing looks for it."""
        self.set_aside(path, "quarantine")

    def set_aside(self, path: Path, folder: str) -> None:
        """Move `path`, at once and whole, into a new directory in `folder` of the store."""
        aside = Path(tempfile.mkdtemp(dir=self.root / folder))
        with contextlib.suppress(FileNotFoundError):  # somebody else was faster
            if path.is_dir() and not path.is_symlink():
                path.chmod(0o755)  # moving a directory writes to its ".."
            path.rename(aside / path.name)

    @contextlib.contextmanager
    def lock(self, key: str, on_wait: Callable[[], None]) -> Iterator[None]:
        """Hold the key's lock; call `on_wait` first where another process holds it."""
        path = self.root / "locks" / key[:2] / f"{key}.lock"
        path.parent.mkdir(exist_ok=True)
        with locked(path, on_wait):
            yield

    @contextlib.contextmanager
    def workspace(self, key: str) -> Iterator[Path]:
        """An empty directory on the store's file system, removed afterwards.

        Its flock tells that its maker lives; those that died at the same key leave theirs to us.
        """
        self._sweep(key)
        with self.run.lease(key):
            fresh = Path(tempfile.mkdtemp(dir=self.root / "tmp"))
            descriptor = os.open(fresh, os.O_RDONLY)
            try_lock(descriptor)
            path = fresh.rename(fresh.with_name(f"{key}-{fresh.name}"))  # nobody met it unlocked
        try:
            yield path
        finally:
            shutil.rmtree(path, ignore_errors=True)
            os.close(descriptor)

    def _sweep(self, key: str) -> None:
        for path in (self.root / "tmp").glob(f"{key}-*"):
            if is_held(path) is False:
                shutil.rmtree(path, ignore_errors=True)


def _opened(folder: Path) -> int:
    """An open directory, made where there is none, even if others remove it meanwhile."""
    while True:
        folder.mkdir(exist_ok=True)
        with contextlib.suppress(FileNotFoundError):
            return os.open(folder, os.O_RDONLY)


def _make(root: Path) -> None:
    """Make the folders of a store; `format` first, so that whoever sees the others sees it, too."""
    root.mkdir(parents=True, exist_ok=True)
    names = [path.name for path in root.iterdir()]
    others = [name for name in names if name != "lost+found" and not name.startswith(".")]
    if others and not (root / "format").exists():
        raise StoreError(
            f"{root} holds other things and is no store: name an empty folder or a new one"
        )
    with contextlib.suppress(FileExistsError), (root / "format").open("x") as file:
        file.write(FORMAT)
    for folder in _FOLDERS:
        (root / folder).mkdir(exist_ok=True)


open_store = functools.cache(Store.open)
"""`Store.open`, once a process and root."""
