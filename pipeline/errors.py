"""The errors of the pipeline, with messages for the user."""

import contextlib
import errno
import os
import shutil
from pathlib import Path
from typing import Literal, TypeAlias

FailureKind: TypeAlias = Literal[
    "user", "crash", "killed", "memory", "timeout", "transient", "changed", "late", "disk"
]
Outcome: TypeAlias = Literal["built", "interrupted"] | FailureKind
Errors: TypeAlias = tuple[type[Exception], ...]
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT)
_ALMOST_FULL_BYTES = 1 << 20


class StoreError(Exception):
    """The store cannot be used as it is, or does not contain the requested thing."""


class NotBuiltError(StoreError):
    """The artifact is not in the store."""


class LostInputError(Exception):
    """The artifact of the named task is lost or was set aside, so that task has to run again."""


class TaskFailure(Exception):  # noqa: N818  it reports a failure
    """The failure of a task, with its reason in one line. A log may contain a trace.

    Args:
        kind: "user": the user's input cannot be used. "crash": the program has a defect.
            "killed": a signal ended the build. "memory": the build used too much memory.
            "timeout": the build took too long. "transient": the cause may pass, such as a lost
            connection. "changed": an input is damaged or was altered. "late": the build would
            not have ended in time. "disk": the disk of this machine is full.
        task: The task as Luigi prints it.
        reason: What happened and what to do.
    """

    def __init__(self, kind: FailureKind, task: str, reason: str) -> None:
        super().__init__(kind, task, reason)
        self.kind, self.task, self.reason = kind, task, reason

    def __str__(self) -> str:
        return f"{self.task}: {self.reason}"


def is_full(error: BaseException | None) -> bool:
    """Returns whether an error says that a disk, or a quota on it, is full."""
    return getattr(error, "errno", None) in _NO_ROOM


def is_disk_full(error: Exception) -> bool:
    """Returns whether an error is or quotes the system's error for a full disk of this machine."""
    is_quoted = any(os.strerror(number) in str(error) for number in _NO_ROOM)
    return is_full(error) or (is_quoted and not isinstance(error, StoreError))


def describe_error(
    error: Exception, log: Path, user_errors: Errors = (), transient_errors: Errors = ()
) -> tuple[FailureKind, str]:
    """Returns the kind of an error and its line for the user.

    Args:
        error: The error.
        log: The log in the store that contains the trace.
        user_errors: The exceptions whose text is meant for the user.
        transient_errors: The exceptions whose cause may pass.
    """
    other: FailureKind = "transient" if isinstance(error, transient_errors) else "crash"
    if isinstance(error, (*user_errors, StoreError)):
        return ("user" if other == "crash" else other), str(error)
    cause = f"{type(error).__name__}: {error}"
    if is_disk_full(error) or _is_almost_full(log.parent):
        where = getattr(error, "filename", None) or log.parent
        return "disk", (
            f"no space left on the disk of {where} ({cause}). No incomplete result was kept. Free"
            " some space, or set STYLETRF_STORE to a folder on another disk, and run the same"
            " command again."
        )
    return other, f"{cause}. The trace is in {log}"


def _is_almost_full(folder: Path) -> bool:
    """Returns whether a disk is almost full. Not every library reports why a write failed."""
    with contextlib.suppress(OSError):
        return shutil.disk_usage(folder).free < _ALMOST_FULL_BYTES
    return False
