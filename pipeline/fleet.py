"""Machines under one luigid build the same things: each tells it the key of what it begins.

A task's name does not tell its code and its data, its key does. Where two machines come to
different keys for one task, their commits, packages or photographs differ: the second stops there.
"""

import contextlib
import logging
import multiprocessing
import os
import re
import signal
import socket
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import luigi
import psutil
from luigi.rpc import RemoteScheduler, RPCError

from pipeline.errors import TaskFailure

if TYPE_CHECKING:
    from pipeline.task import StoredTask

screen = logging.getLogger("pipeline")
_TOLD = re.compile(r"key (?P<key>\w+) on (?P<host>\S+), process (?P<pid>\d+)")


def announce(task: "StoredTask", key: str) -> None:
    """Tell luigid the key of a task that begins; nothing where no luigid is asked.

    Raises:
        TaskFailure: A machine that is at work has another key for it.
    """
    if not _has_luigid() or not getattr(task, "set_status_message", None):
        return
    require_agreement(task, key)
    host, pid = _ours()
    with contextlib.suppress(RPCError):
        task.set_status_message(f"key {key[:16]} on {host}, process {pid}")  # type: ignore[misc]


def require_agreement(task: "StoredTask", key: str) -> None:
    """Look whether another machine under the same luigid has the same key for a task.

    Raises:
        TaskFailure: One that is at work has another.
    """
    if not _has_luigid():
        return
    with contextlib.suppress(RPCError):  # a luigid that is away: what is built is right anyway
        scheduler = _scheduler()
        told = _TOLD.search(scheduler.get_task_status_message(task.task_id)["statusMessage"] or "")
        theirs = (told["host"], told["pid"]) if told else _ours()
        differs = told and theirs != _ours() and told["key"] != key[:16]
        if told and differs and _is_at_work(scheduler, *theirs):
            raise TaskFailure(
                "user",
                str(task),
                f"{theirs[0]} has {told['key']} for it and this machine {key[:16]}: they have other"
                " code, packages, settings or photographs. Give all machines under a luigid the"
                " same; if its command is over, go on in ten minutes, or restart luigid.",
            )


def heed(failure: TaskFailure) -> None:
    """After one for want of room, have the command ask luigid for nothing more: others have room.

    Else it would go on to take, and to fail, so much that soon nobody may try it again.
    """
    is_worker = callable(signal.getsignal(signal.SIGUSR1))  # by which Luigi's worker is told
    if failure.kind == "disk" and is_worker and _has_luigid():
        screen.warning("This command takes nothing more from luigid; what it runs is ended first.")
        os.kill(int(_ours()[1]), signal.SIGUSR1)


def forgive(tasks: Callable[[], Iterable[luigi.Task]]) -> None:
    """Have luigid let a new command try what failed for earlier ones; for a day it would not.

    Args:
        tasks: Tells all that the command asks for; called where anything failed.
    """
    if not _has_luigid():
        return
    with contextlib.suppress(RPCError):
        scheduler = _scheduler()
        failed = scheduler.task_list("DISABLED", "", limit=False)
        asked = {task.task_id for task in tasks()} if failed else set()
        for task_id in asked.intersection(failed):
            scheduler.re_enable_task(task_id)


def is_forgotten() -> bool:
    """Whether luigid has lost sight of this command: it was restarted, and knows of no task of it.

    Its worker is then told that there is nothing to do, and ends.
    """
    if not _has_luigid():
        return False
    luigi.configuration.get_config().set("core", "rpc-retry-attempts", "1")  # type: ignore[no-untyped-call]
    with contextlib.suppress(RPCError):  # the worker has waited for it
        return not _is_known(_scheduler(), *_ours())
    return False


def _scheduler() -> Any:
    return RemoteScheduler(luigi.interface.core().scheduler_url)  # type: ignore[no-untyped-call]


def _has_luigid() -> bool:
    return not luigi.interface.core().local_scheduler  # type: ignore[no-untyped-call]


def _ours() -> tuple[str, str]:
    """This host, and the process of the command."""
    command = multiprocessing.parent_process()
    return socket.gethostname(), str((command and command.pid) or os.getpid())


def _is_at_work(scheduler: Any, host: str, pid: str) -> bool:
    """Whether the command with this process still runs, as far as luigid or this machine knows."""
    if host == socket.gethostname():
        return bool(psutil.pid_exists(int(pid)))
    return _is_known(scheduler, host, pid)


def _is_known(scheduler: Any, host: str, pid: str) -> bool:
    """Whether luigid knows a command by its process."""
    workers = scheduler.worker_list(include_running=False)
    return (host, pid) in [(w.get("host"), str(w.get("pid"))) for w in workers]
