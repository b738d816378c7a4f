"""Checkpoints in the shared store, so that another machine goes on where a lost one was.

    resume/<key>/<time>-<digest>-<bytes>-<files>.tar

Like everything there they are believed only with the digest that their name tells. Whoever builds
the key removes them.
"""

import contextlib
import logging
import os
import shutil
import threading
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from pipeline.archive import pack, unpack
from pipeline.digest import Tree, tree_digest
from pipeline.remote import Remote
from pipeline.settings import current_remote, setting

screen = logging.getLogger("pipeline")


@contextlib.contextmanager
def shared_checkpoints(key: str, resume: Path) -> Iterator[None]:
    """Bring the newest checkpoint where there is none here, and give those that come.

    Every `[store] checkpoint_seconds`, and when the build fails; nothing where there is no shared
    store.

    Args:
        key: Of the build.
        resume: Its folder of checkpoints.
    """
    remote, seconds = current_remote(), float(setting("store", "checkpoint_seconds"))
    if not remote.url or seconds <= 0 or setting("store", "push") != "true":
        yield
        return
    with contextlib.suppress(OSError):
        if not any(resume.iterdir()):
            remote.attempt("reading", partial(_bring, key, resume))
    keeper = _Keeper(key, resume, remote)
    is_over = threading.Event()
    thread = threading.Thread(target=keeper.keep_until, args=(is_over, seconds), daemon=True)
    thread.start()
    try:
        yield
    except BaseException:
        keeper.keep()
        raise
    finally:
        is_over.set()
        thread.join()


def forget_checkpoints(key: str) -> None:
    """Remove those of a key that is built."""
    current_remote().attempt("writing", lambda remote: _remove(remote, key, remote.names(_at(key))))


class _Keeper:
    """Uploads a folder of checkpoints whenever it has changed."""

    def __init__(self, key: str, resume: Path, remote: Remote) -> None:
        self._key, self._resume, self._remote = key, resume, remote
        self._kept: list[tuple[str, int, int]] = []

    def keep_until(self, is_over: threading.Event, seconds: float) -> None:
        """Keep them now and then."""
        while not is_over.wait(seconds):
            self.keep()

    def keep(self) -> None:
        """Upload the folder if it has changed; what was uploaded before is removed."""
        with contextlib.suppress(OSError, ValueError):  # the disk is full, or a file just went
            found = self._state()
            if found and found != self._kept:
                self._remote.attempt("writing", self._upload)
                self._kept = found

    def _state(self) -> list[tuple[str, int, int]]:
        """The checkpoints as they are; not the notes beside them, whose names begin with a dot."""
        files = ((p.name, p.stat()) for p in self._resume.iterdir() if p.name[0] != ".")
        return sorted((name, status.st_mtime_ns, status.st_size) for name, status in files)

    def _upload(self, remote: Remote) -> None:
        archive, still = (
            self._resume.with_name(f"{self._resume.name}.{e}") for e in ("tar", "still")
        )
        try:
            shutil.copytree(self._resume, still, copy_function=_hold_still)
            tree = tree_digest(still)
            pack(still, archive)
            before = remote.names(_at(self._key))
            told = f"{datetime.now(UTC):%Y%m%dT%H%M%S.%f}-{tree.digest}-{tree.size}-{tree.files}"
            remote.create(f"{_at(self._key)}/{told}.tar", archive)
            _remove(remote, self._key, before)
        finally:
            archive.unlink(missing_ok=True)
            shutil.rmtree(still, ignore_errors=True)


def _hold_still(source: str, target: str) -> None:
    """A link to a checkpoint, which is replaced and never written to; a copy of a note."""
    (shutil.copyfile if Path(source).name[0] == "." else os.link)(source, target)


def _bring(key: str, resume: Path, remote: Remote) -> None:
    """Fill the empty folder from the newest archive that is whole."""
    for name in sorted(remote.names(_at(key)), reverse=True):
        archive, unpacked = (resume.with_name(f"{resume.name}.{end}") for end in ("tar", "new"))
        try:
            _, digest, size, files = name.removesuffix(".tar").split("-")
            remote.download(f"{_at(key)}/{name}", archive)
            unpack(archive, unpacked, Tree(digest, int(size), int(files)))
            if tree_digest(unpacked).digest == digest:
                for path in unpacked.iterdir():
                    path.rename(resume / path.name)
                screen.info("going on from a checkpoint that %s has", remote.url)
                return
        except ValueError as error:
            screen.warning("%s/%s in %s is wrong: %s", _at(key), name, remote.url, error)
        finally:
            archive.unlink(missing_ok=True)
            shutil.rmtree(unpacked, ignore_errors=True)


def _remove(remote: Remote, key: str, names: list[str]) -> None:
    for name in names:
        remote.remove(f"{_at(key)}/{name}")


def _at(key: str) -> str:
    return f"resume/{key}"
