"""What can go wrong, in the words its user reads."""

import contextlib
import errno
import os
import shutil
import traceback
from pathlib import Path
from typing import Literal, TypeAlias

FailureKind: TypeAlias = Literal[
    "user", "crash", "killed", "memory", "timeout", "transient", "changed", "late", "disk"
]
Errors: TypeAlias = tuple[type[Exception], ...]
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT)
_NEXT_TO_NOTHING_BYTES = 1 << 20


class StoreError(Exception):
    """The store cannot be used as it is, or does not hold what was asked of it."""


class NotBuiltError(StoreError):
    """The artifact is not in the store."""


class LostInputError(Exception):
    """The task that it names has to run again first: what it made is gone or was set aside."""


class TaskFailure(Exception):  # noqa: N818  it reports a failure, the error is elsewhere
    """A task that failed for a reason worth one line; the trace, if there is one, is in a log.

    Args:
        kind: "user": what the user gave cannot be used. "crash": a defect. "killed": by a signal.
            "memory": it took too much. "timeout": it took too long. "transient": what may pass, as
            a lost network. "changed": what it read is damaged or was altered. "late": it would not
            have ended in time. "disk": that of this machine is full.
        task: The task as Luigi prints it.
        reason: What happened and what to do.
    """

    def __init__(self, kind: FailureKind, task: str, reason: str) -> None:
        super().__init__(kind, task, reason)
        self.kind, self.task, self.reason = kind, task, reason

    def __str__(self) -> str:
        return f"{self.task}: {self.reason}"


def is_full(error: BaseException | None) -> bool:
    """Whether a disk, or what somebody may have of it, is full."""
    return getattr(error, "errno", None) in _NO_ROOM


def is_disk_full(error: Exception) -> bool:
    """Whether an error is, or quotes, that of the system for a full disk; not another machine's."""
    is_quoted = any(os.strerror(number) in str(error) for number in _NO_ROOM)
    return is_full(error) or (is_quoted and not isinstance(error, StoreError))


def describe_error(
    error: Exception, log: Path, user_errors: Errors = (), transient_errors: Errors = ()
) -> tuple[FailureKind, str]:
    """Whose an error is, and its line on the screen; `log` lies in the store and has the trace."""
    other: FailureKind = "transient" if isinstance(error, transient_errors) else "crash"
    if isinstance(error, (*user_errors, StoreError)):
        return ("user" if other == "crash" else other), str(error)
    cause = f"{type(error).__name__}: {error}"
    if is_disk_full(error) or _is_short(log.parent):
        where = getattr(error, "filename", None) or log.parent
        return "disk", (
            f"no space left on the disk of {where} ({cause}). Nothing half-made was kept: free some"
            " space, or set STYLETRF_STORE to a folder on another disk, and run the same"
            " command again."
        )
    return other, f"{cause}. The trace is in {log}"


def _is_short(folder: Path) -> bool:
    """Whether next to nothing is free there: many a library does not say why it failed to write."""
    with contextlib.suppress(OSError):
        return shutil.disk_usage(folder).free < _NEXT_TO_NOTHING_BYTES
    return False


def append_trace(log: Path) -> None:
    """Adds the exception being handled to a log, if the disk has room for it."""
    with contextlib.suppress(OSError), log.open("a") as file:
        traceback.print_exc(file=file)
