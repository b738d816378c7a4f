"""Checkpoints in the shared store, from which another machine continues a lost build.

    resume/<key>/<time of writing>-<digest>-<bytes>-<files>[-<signature>].tar

A machine uses a checkpoint only if its content has the digest in its name. With a signing key
(`signatures.py`), the name must be signed, too. The machine that builds the key removes them.

Clocks of machines may differ. A checkpoint that continues from an archive is never older than the
archive: a local folder keeps the time of the archive that it was last downloaded from or uploaded
to.
"""

import contextlib
import logging
import os
import shutil
import threading
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

from pipeline.digest import Tree, tree_digest
from pipeline.settings import boolean_setting, number_setting
from pipeline.shared_store.archive import pack, unpack
from pipeline.shared_store.remote import Remote
from pipeline.shared_store.settings import current_remote
from pipeline.shared_store.signatures import is_signed, signature

_TIME = "%Y%m%dT%H%M%S.%f"  # in UTC
_SHARED = ".shared"  # beside the checkpoints: the time in the name of their archive
_log = logging.getLogger("pipeline")


@contextlib.contextmanager
def shared_checkpoints(key: str, resume: Path) -> Iterator[Callable[[], None]]:
    """Downloads the newest checkpoint if it is newer than the local one, then uploads new ones.

    It uploads every `[store] checkpoint_seconds`, and after an exception. It does nothing without a
    shared store, or if uploads are switched off.

    Args:
        key: The key of the build.
        resume: Its folder of checkpoints.

    Yields:
        A function to call if the build failed, which uploads the last checkpoint.
    """
    if not _are_shared():
        yield lambda: None
        return
    remote, seconds = current_remote(), number_setting("store", "checkpoint_seconds")
    try:
        remote.call_or_none("reading", partial(_download_newest, key, resume))
    except OSError as error:  # of the local disk
        _log.warning("no checkpoint was taken from %s: %s", remote.url, error)
    uploader = CheckpointUploader(key, resume, remote)
    is_over = threading.Event()
    thread = threading.Thread(target=uploader.run, args=(is_over, seconds), daemon=True)
    thread.start()

    def stop() -> None:
        is_over.set()
        thread.join()

    def fail() -> None:
        stop()
        uploader.upload()

    try:
        yield fail
    except BaseException:
        fail()
        raise
    finally:
        stop()


def forget_checkpoints(key: str) -> None:
    """Removes the shared checkpoints of a key that is built."""
    if _are_shared():
        current_remote().call_or_none("writing", lambda r: _remove(r, key, r.names(_at(key))))


def _are_shared() -> bool:
    is_on = boolean_setting("store", "push") and number_setting("store", "checkpoint_seconds") > 0
    return is_on and bool(current_remote().url)


def _checkpoints(resume: Path) -> list[tuple[str, int, int]]:
    """Returns the checkpoints with times and sizes, without the dot files beside them."""
    files = ((p.name, p.stat()) for p in resume.iterdir() if p.name[0] != ".")
    return sorted((name, status.st_mtime_ns, status.st_size) for name, status in files)


def _written(resume: Path) -> datetime:
    """Returns when this machine wrote the newest checkpoint of a folder, by its own clock."""
    newest_ns = max((time_ns for _, time_ns, _ in _checkpoints(resume)), default=0)
    return datetime.fromtimestamp(newest_ns / 1e9, UTC)


def _shared(resume: Path) -> datetime:
    """Returns the time of the archive that a folder of checkpoints was continued from."""
    with contextlib.suppress(OSError, ValueError):
        if _checkpoints(resume):
            return _parsed_time((resume / _SHARED).read_text())
    return datetime.fromtimestamp(0, UTC)


def _parsed_time(text: str) -> datetime:
    return datetime.strptime(f"{text}+0000", f"{_TIME}%z")


class CheckpointUploader:
    """Uploads a folder of checkpoints whenever it has changed."""

    def __init__(self, key: str, resume: Path, remote: Remote) -> None:
        self._key, self._resume, self._remote = key, resume, remote
        self._uploaded: list[tuple[str, int, int]] = []

    def run(self, is_over: threading.Event, seconds: float) -> None:
        """Uploads at intervals of `seconds`, until `is_over`."""
        while not is_over.wait(seconds):
            self.upload()

    def upload(self) -> None:
        """Uploads the folder if it has changed, and removes older checkpoints."""
        with contextlib.suppress(OSError, ValueError):  # the disk is full, or a file was deleted
            found = _checkpoints(self._resume)
            is_new = found and found != self._uploaded
            if is_new and self._remote.call_or_none("writing", self._upload):
                self._uploaded = found

    def _upload(self, remote: Remote) -> bool:
        """Returns True, unlike a call that fails."""
        with _temporary(self._resume, "still") as (archive, still):
            others = shutil.ignore_patterns(".*.partial*", _SHARED)  # unfinished, or of this folder
            shutil.copytree(self._resume, still, copy_function=_hardlink_or_copy, ignore=others)
            tree = tree_digest(still)
            pack(still, archive)
            written = max(_written(still), _shared(self._resume) + timedelta(microseconds=1))
            description = f"{written:{_TIME}}-{tree.digest}-{tree.size}-{tree.files}"
            mark = _signature(remote, self._key, description)
            name = "-".join(filter(None, [description, mark])) + ".tar"
            remote.create(f"{_at(self._key)}/{name}", archive)
            older = [other for other in remote.names(_at(self._key)) if other < name]
            _remove(remote, self._key, older)
            (self._resume / _SHARED).write_text(f"{written:{_TIME}}")
        return True


@contextlib.contextmanager
def _temporary(resume: Path, end: str) -> Iterator[tuple[Path, Path]]:
    """Yields the paths of a new archive and a new folder beside the checkpoints.

    Both are removed afterwards, and before: a killed process may have left them.
    """
    archive, folder = (resume.with_name(f"{resume.name}.{each}") for each in ("tar", end))

    def remove() -> None:
        archive.unlink(missing_ok=True)
        shutil.rmtree(folder, ignore_errors=True)

    remove()
    try:
        yield archive, folder
    finally:
        remove()


def _hardlink_or_copy(source: str, target: str) -> None:
    """Links a checkpoint, which is only ever replaced; copies a dot file."""
    (shutil.copyfile if Path(source).name[0] == "." else os.link)(source, target)


def _download_newest(key: str, resume: Path, remote: Remote) -> None:
    """Fills the folder from the newest intact archive that is newer than the folder."""
    here = f"{max(_written(resume), _shared(resume)):{_TIME}}"
    for name in sorted(remote.names(_at(key)), reverse=True):
        if name.partition("-")[0] <= here:
            return
        if not _is_trusted(remote, key, name):
            remote.warn_unsigned("checkpoint", "unsigned, or signed by another key")
            continue
        try:
            with _temporary(resume, "new") as (archive, unpacked):
                _unpack_checkpoint(remote, f"{_at(key)}/{name}", archive, unpacked)
                for path in resume.iterdir():
                    shutil.rmtree(path) if path.is_dir() else path.unlink()
                for path in unpacked.iterdir():
                    path.rename(resume / path.name)
            _log.info("continuing from a checkpoint in %s", remote.url)
            return
        except ValueError as error:
            _log.warning(
                "the checkpoint %s/%s in %s is damaged: %s", _at(key), name, remote.url, error
            )


def _unpack_checkpoint(remote: Remote, file: str, archive: Path, unpacked: Path) -> None:
    """Downloads the files of a checkpoint, and gives them the time in its name.

    Raises:
        ValueError: It has another name than a checkpoint, or another content than its name says.
    """
    written, digest, size, files = file.rpartition("/")[2].removesuffix(".tar").split("-")[:4]
    written_s = _parsed_time(written).timestamp()
    remote.download(file, archive)
    unpack(archive, unpacked, Tree(digest, int(size), int(files)))
    if tree_digest(unpacked).digest != digest:
        raise ValueError("it does not have the digest in its name")
    (unpacked / _SHARED).write_text(written)
    for path in unpacked.iterdir():
        os.utime(path, (written_s, written_s))


def _signature(remote: Remote, key: str, description: str) -> str:
    """Returns the signature of a checkpoint's description; empty without a signing key."""
    return signature(remote.key, *_signed(key, description)) if remote.key else ""


def _is_trusted(remote: Remote, key: str, name: str) -> bool:
    """Whether the name is signed, or needs no signature."""
    description, _, mark = name.removesuffix(".tar").rpartition("-")
    return not remote.key or is_signed(mark, remote.key, *_signed(key, description))


def _signed(key: str, description: str) -> tuple[str, bytes, bytes]:
    return "pipeline-signed-checkpoint-v1", key.encode(), description.encode()


def _remove(remote: Remote, key: str, names: list[str]) -> None:
    for name in names:
        remote.remove(f"{_at(key)}/{name}")


def _at(key: str) -> str:
    return f"resume/{key}"
