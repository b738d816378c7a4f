"""The place of a shared store: bytes by name, in a directory or a bucket, never replaced."""

import contextlib
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

Answer = TypeVar("Answer")
_log = logging.getLogger("pipeline")

CIRCUIT_OPEN_S = 60.0
_SECONDS_BETWEEN_TRIES = 3.0
_RETRIES = {"mode": "standard", "total_max_attempts": 3}  # lost connections, throttling, 5xx
_S3: dict[str, Any] = {
    "use_listings_cache": False,
    "max_concurrency": 1,  # so that a download goes on where its connection broke
    "config_kwargs": {"connect_timeout": 3, "read_timeout": 5, "retries": _RETRIES},
}
_REMEDY = (
    "It has to be a folder that exists, or s3://BUCKET/PREFIX with a bucket that exists,"
    " credentials and AWS_ENDPOINT_URL as for any S3 client, and `pip install 'styletrf[s3]'`"
)


@dataclass(frozen=True)
class Remote:
    """A directory (a path, `file://`) or a bucket (`s3://bucket/prefix`) that machines share.

    Every method but `call_or_none` raises `StoreError` when the remote cannot be used, after enough
    attempts at what may pass: unreachable, no such bucket, not permitted, no extra `s3` installed.

    Attributes:
        url: Where it is; "" for none.
        options: JSON for the fsspec file system, beside the environment's AWS_ENDPOINT_URL etc.
        patience_seconds: How long `call_or_none` retries a transient failure.
        key: What records and checkpoints there are signed by, and have to be; none: they are not.
        reached: Called with the name of each point that an upload reaches; tests kill there.
    """

    url: str
    options: str = "{}"
    patience_seconds: float = 0.0
    key: bytes = field(default=b"", repr=False)
    reached: Callable[[str], None] = nothing
    _silent_until: dict[str, float] = field(default_factory=dict, compare=False, repr=False)
    _distrusted: set[str] = field(default_factory=set, compare=False, repr=False)

    def call_or_none(self, kind: str, call: Callable[["Remote"], Answer]) -> Answer | None:
        """What `call` answers; None where there is no remote or, after a warning, it fails.

        For a minute after a failure in "reading" nothing is called, and none of "writing" after
        one in "writing".
        """
        if not self.url or self.is_silent(kind):
            return None
        try:
            return self._with_retries(call)
        except StoreError as error:
            self._silent_until[kind] = time.monotonic() + CIRCUIT_OPEN_S
            reason = str(error).rstrip(".")
            _log.warning("%s. Going on without %s there for a minute.", reason, kind)
            return None

    def is_silent(self, kind: str) -> bool:
        """Whether a failure is so recent that nothing of the kind is called."""
        silent_until = max(self._silent_until.get(each, 0) for each in ("reading", kind))
        return time.monotonic() < silent_until

    def distrust(self, sort: str, why: str) -> None:
        """Say, once a process, that a sort of what is there is not signed as it has to be."""
        if sort not in self._distrusted:
            text = "A %s in %s is %s: it counts as absent, and so does every other such %s."
            _log.warning(text, sort, self.url, why, sort)
        self._distrusted.add(sort)

    def _with_retries(self, call: Callable[["Remote"], Answer]) -> Answer:
        """What `call` answers, called again while its failure may pass and patience lasts."""
        end = time.monotonic() + self.patience_seconds
        say_once = functools.cache(partial(_log.warning, "%s. Waiting for it for up to %.0f s."))
        while True:
            try:
                return call(self)
            except StoreError as error:
                if time.monotonic() >= end or not _is_transient(error.__cause__):
                    raise
                say_once(str(error).rstrip("."), self.patience_seconds)
            time.sleep(_SECONDS_BETWEEN_TRIES)

    def read(self, name: str) -> bytes | None:
        """The bytes of that name, if there are any."""
        with self._at(name) as (files, path):
            try:
                return bytes(files.cat_file(path))
            except FileNotFoundError as error:
                if "NoSuchBucket" in str(error.__cause__):
                    raise
                return None

    def read_all(self, folder: str) -> list[bytes]:
        """The bytes of every name in the folder."""
        with self._at(folder) as (files, path):
            names = files.find(path)
            return list(files.cat(names, on_error="omit").values()) if names else []

    def has(self, name: str) -> bool:
        """Whether there is that name."""
        with self._at(name) as (files, path):
            return bool(files.exists(path))

    def names(self, folder: str) -> list[str]:
        """The names in the folder; none where there is no such folder."""
        with self._at(folder) as (files, path):
            return sorted(Path(found).name for found in files.find(path))

    def remove(self, name: str) -> None:
        """Take the name away; that it is gone already is as good."""
        with self._at(name) as (files, path), contextlib.suppress(FileNotFoundError):
            files.rm_file(path)

    def download(self, name: str, target: Path) -> None:
        """Copy the bytes of that name, unchecked, into a file; raises OSError when that is full."""
        try:
            with self._at(name) as (files, path):
                files.retries = 3  # going on from where the connection broke
                files.get_file(path, os.fspath(target))
        except StoreError as error:
            if is_full(error.__cause__):
                raise OSError(*cast("OSError", error.__cause__).args, os.fspath(target)) from error
            raise

    def create(self, name: str, source: Path) -> bool:
        """Give the bytes of a file that name, all at once; False where the name is taken."""
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

    def set_aside(self, name: str) -> None:
        """Move the bytes of that name to where nothing looks for them."""
        with self._at(name) as (files, path):
            aside = f"{path.removesuffix(name)}quarantine/{uuid.uuid4().hex}"
            files.makedirs(aside, exist_ok=True)
            with contextlib.suppress(FileNotFoundError):  # somebody else was faster
                files.mv(path, f"{aside}/{Path(name).name}")

    def _link(self, source: Path, target: Path, root: Path) -> None:
        """Only a link replaces nothing, even on NFS."""
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
        """The file system, and a name's path there; each of its failures is reported."""
        try:
            from fsspec.core import url_to_fs  # here, since most runs share nothing

            if not self.url:
                raise ValueError("none is set by STYLETRF_REMOTE or [store] remote")
            is_s3 = self.url.startswith("s3://")
            options = {**(_S3 if is_s3 else {}), **json.loads(self.options)}
            files, path = url_to_fs(f"{self.url.rstrip('/')}/{name}", **options)
            files.retries = 1  # by s3fs; each request already has its own
            if not is_s3 and not Path(path.removesuffix(name)).is_dir():
                raise FileNotFoundError("there is no such folder")
            yield files, path
        except Exception as error:
            text = str(error).rstrip(".") or type(error).__name__
            raise StoreError(f"the shared store {self.url}: {text}. {_REMEDY}.") from error


def _is_transient(cause: BaseException | None) -> bool:
    """Whether it is a connection or a server that failed: nothing missing, nothing forbidden."""
    names = {each.__name__ for each in type(cause).__mro__}
    is_lasting = isinstance(cause, FileNotFoundError | PermissionError)
    return bool({"OSError", "HTTPClientError"} & names) and not is_lasting


open_remote = functools.cache(Remote)
"""The `Remote` of a URL, its options and a patience, once a process."""
