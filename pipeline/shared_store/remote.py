"""The files of a shared store, in a directory or a bucket. They are never replaced."""

import contextlib
import errno
import functools
import json
import logging
import os
import shutil
import time
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast

from pipeline.errors import StoreError, is_full
from pipeline.publication import sync
from pipeline.store import nothing

Result = TypeVar("Result")
_log = logging.getLogger("pipeline")

CIRCUIT_OPEN_S = 60.0
_SECONDS_BETWEEN_TRIES = 3.0
_RETRIES = {"mode": "standard", "total_max_attempts": 3}  # lost connections, throttling, 5xx
_S3: dict[str, Any] = {
    "use_listings_cache": False,
    "max_concurrency": 1,  # so that a download continues after a broken connection
    "config_kwargs": {"connect_timeout": 3, "read_timeout": 5, "retries": _RETRIES},
}
_LASTING = (errno.EROFS, errno.ENOTDIR, errno.ENAMETOOLONG)
_REMEDY = (
    "It has to be a folder that exists, or s3://BUCKET/PREFIX with a bucket that exists,"
    " credentials and AWS_ENDPOINT_URL as for any S3 client, and `pip install 'styletrf[s3]'`"
)


@dataclass(frozen=True)
class Remote:
    """A directory (a path, `file://`) or a bucket (`s3://bucket/prefix`) that machines share.

    Every method except `call_or_none` raises `StoreError` if the remote cannot be used: it does not
    exist or answer, access is denied, or the extra `s3` is not installed. Connections are retried.

    Attributes:
        url: Its path or URL; "" for none.
        options: JSON for the fsspec file system, in addition to AWS_ENDPOINT_URL and others.
        patience_seconds: How long `call_or_none` retries a transient failure.
        key: The key that signs its records and checkpoints; empty: they are not signed.
        reached: Called with the name of each point that an upload reaches. Tests kill there.
    """

    url: str
    options: str = "{}"
    patience_seconds: float = 0.0
    key: bytes = field(default=b"", repr=False)
    reached: Callable[[str], None] = nothing
    _open_until: dict[str, float] = field(default_factory=dict, compare=False, repr=False)
    _warned: set[str] = field(default_factory=set, compare=False, repr=False)

    def call_or_none(self, kind: str, call: Callable[["Remote"], Result]) -> Result | None:
        """Returns the result of `call`; None without a remote or, after a warning, on failure.

        For a minute after a failure of kind "reading" it calls nothing, and after a failure of
        kind "writing" it calls nothing of this kind.
        """
        if not self.url or self.is_open(kind):
            return None
        try:
            return self._with_retries(call)
        except StoreError as error:
            self._open_until[kind] = time.monotonic() + CIRCUIT_OPEN_S
            reason = str(error).rstrip(".")
            _log.warning("%s. Continuing without %s there for a minute.", reason, kind)
            return None

    def is_open(self, kind: str) -> bool:
        """Whether the circuit breaker is open: a recent failure suspends all calls of this kind."""
        open_until = max(self._open_until.get(each, 0) for each in ("reading", kind))
        return time.monotonic() < open_until

    def warn_unsigned(self, sort: str, problem: str) -> None:
        """Warns once in a process about unsigned records, or about unsigned checkpoints."""
        if sort not in self._warned:
            text = "A %s in %s is %s. It counts as absent, and so does every other such %s."
            _log.warning(text, sort, self.url, problem, sort)
        self._warned.add(sort)

    def _with_retries(self, call: Callable[["Remote"], Result]) -> Result:
        """Returns the result of `call`, and retries transient failures for `patience_seconds`."""
        end = time.monotonic() + self.patience_seconds
        warn_once = functools.cache(partial(_log.warning, "%s. Retrying for up to %.0f s."))
        while True:
            try:
                return call(self)
            except StoreError as error:
                if time.monotonic() >= end or not _is_transient(error.__cause__):
                    raise
                warn_once(str(error).rstrip("."), self.patience_seconds)
            time.sleep(_SECONDS_BETWEEN_TRIES)

    def read(self, name: str) -> bytes | None:
        """Returns the bytes of a file; None if there is no such file."""
        with self._at(name) as (files, path):
            try:
                return bytes(files.cat_file(path))
            except FileNotFoundError as error:
                if "NoSuchBucket" in str(error.__cause__):
                    raise
                return None

    def read_all(self, folder: str) -> list[bytes]:
        """Returns the bytes of every file in the folder, except those removed meanwhile."""
        with self._at(folder) as (files, path):
            names = files.find(path)
            found = files.cat(names, on_error="return").values() if names else []
            for each in found:
                if isinstance(each, Exception) and not isinstance(each, FileNotFoundError):
                    raise each
            return [each for each in found if isinstance(each, bytes)]

    def has(self, name: str) -> bool:
        """Returns whether there is a file of this name."""
        with self._at(name) as (files, path):
            return bool(files.exists(path))

    def names(self, folder: str) -> list[str]:
        """Returns the names in the folder; none if there is no such folder."""
        with self._at(folder) as (files, path):
            return sorted(Path(found).name for found in files.find(path))

    def remove(self, name: str) -> None:
        """Removes a file, if it exists."""
        with self._at(name) as (files, path), contextlib.suppress(FileNotFoundError):
            files.rm_file(path)

    def download(self, name: str, target: Path) -> None:
        """Copies a file, without a check; raises OSError if the local disk is full."""
        try:
            with self._at(name) as (files, path):
                files.retries = 3  # it continues where the connection broke
                files.get_file(path, os.fspath(target))
        except StoreError as error:
            if is_full(error.__cause__):
                raise OSError(*cast("OSError", error.__cause__).args, os.fspath(target)) from error
            raise

    def create(self, name: str, source: Path) -> bool:
        """Uploads a file atomically; returns False if the name is already taken."""
        with self._at(name) as (files, path):
            try:
                if "file" in files.protocol:
                    self._link(source, Path(path), Path(path.removesuffix(name)))
                else:
                    files.put_file(os.fspath(source), path, mode="create")
            except OSError as error:
                if "PreconditionFailed" in str(error.__cause__) or isinstance(
                    error, FileExistsError
                ):
                    return False
                raise
        return True

    def set_aside(self, name: str) -> str:
        """Moves a file into `quarantine/`, where no build reads it; returns its name there."""
        folder = f"quarantine/{uuid.uuid4().hex}"
        with self._at(name) as (files, path):
            aside = f"{path.removesuffix(name)}{folder}"
            files.makedirs(aside, exist_ok=True)
            with contextlib.suppress(FileNotFoundError):  # another machine was faster
                files.mv(path, f"{aside}/{Path(name).name}")
        return f"{folder}/{Path(name).name}"

    def _link(self, source: Path, target: Path, root: Path) -> None:
        """Copies a file to `target` by a link, which replaces nothing, even on NFS."""
        temporary = root / "tmp" / uuid.uuid4().hex
        for folder in (temporary.parent, target.parent):
            folder.mkdir(parents=True, exist_ok=True)
        try:
            shutil.copyfile(source, temporary)
            sync(temporary)
            self.reached("copied")
            target.hardlink_to(temporary)
            self.reached("linked")
            sync(target.parent)
        finally:
            temporary.unlink(missing_ok=True)

    @contextlib.contextmanager
    def _at(self, name: str) -> Iterator[tuple[Any, str]]:
        """Yields the file system and the path of a name; failures become `StoreError`."""
        try:
            from fsspec.core import url_to_fs  # imported only if there is a shared store

            if not self.url:
                raise ValueError("neither STYLETRF_REMOTE nor [store] remote is set")
            is_s3 = self.url.startswith("s3://")
            options = {**(_S3 if is_s3 else {}), **json.loads(self.options)}
            files, path = url_to_fs(f"{self.url.rstrip('/')}/{name}", **options)
            files.retries = 1  # of s3fs; each request has retries of its own
            if not is_s3 and not Path(path.removesuffix(name)).is_dir():
                raise FileNotFoundError("there is no such folder")
            yield files, path
        except Exception as error:
            text = str(error).rstrip(".") or type(error).__name__
            raise StoreError(f"the shared store {self.url}: {text}. {_REMEDY}.") from error


def _is_transient(cause: BaseException | None) -> bool:
    """Whether a connection or a server failed, rather than something that only a person mends."""
    names = {each.__name__ for each in type(cause).__mro__}
    is_lasting = isinstance(cause, FileNotFoundError | PermissionError) or is_full(cause)
    is_lasting |= getattr(cause, "errno", None) in _LASTING
    return bool({"OSError", "HTTPClientError"} & names) and not is_lasting


open_remote = functools.cache(Remote)
"""`Remote`, created once for equal arguments in a process."""
