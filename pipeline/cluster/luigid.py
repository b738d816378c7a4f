"""The messages between a command and a luigid that several machines share.

Each command publishes the key of a task that it starts. Two machines that compute different keys
for one task have different commits, packages or photographs, so the second one stops. Without a
luigid (`local_scheduler`), and while luigid does not answer, every function here does nothing.
"""

import contextlib
import json
import logging
import multiprocessing
import os
import signal
import socket
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import luigi
import psutil
from luigi.rpc import RemoteScheduler, RPCError

from pipeline.errors import TaskFailure

_log = logging.getLogger("pipeline")


def publish_key(task: luigi.Task, key: str) -> None:
    """Publishes the key of a task that starts, as its status message on luigid.

    Raises:
        TaskFailure: A command that is running has published another key for the task.
    """
    if not _has_luigid() or not getattr(task, "set_status_message", None):
        return
    require_same_key(task, key)
    host, pid = _own_command()
    with contextlib.suppress(RPCError):
        message = json.dumps({"key": key[:16], "host": host, "process": pid})
        task.set_status_message(message)  # type: ignore[misc]


def require_same_key(task: luigi.Task, key: str) -> None:
    """Compares the key of a task with the one that another command has published.

    Raises:
        TaskFailure: A command that is running has published another key.
    """
    if not _has_luigid():
        return
    with contextlib.suppress(RPCError):  # without luigid's answer the build is still correct
        scheduler = _scheduler()
        published = _published(scheduler, task.task_id)
        if not published or published["key"] == key[:16]:
            return
        command = published["host"], published["process"]
        if command != _own_command() and _is_running(scheduler, *command):
            raise TaskFailure(
                "user",
                str(task),
                f"{published['host']} has key {published['key']} for it, this machine {key[:16]}:"
                " their code, packages, settings or photographs differ. Give all machines of a"
                " luigid the same. If the other command has ended, run this one again in ten"
                " minutes, or restart luigid.",
            )


def _published(scheduler: Any, task_id: str) -> dict[str, str]:
    """Returns the message of `publish_key` for a task; empty if no command published one."""
    with contextlib.suppress(ValueError, KeyError, TypeError):
        message = json.loads(scheduler.get_task_status_message(task_id)["statusMessage"])
        return {name: str(message[name]) for name in ("key", "host", "process")}
    return {}


def stop_requesting_work(failure: TaskFailure) -> None:
    """Stops the command from requesting tasks of luigid, after a full disk.

    Otherwise the command would fail one task after the other, until luigid disables them for all
    machines.
    """
    handles_signal = callable(signal.getsignal(signal.SIGUSR1))  # as in a worker of Luigi
    if failure.kind == "disk" and handles_signal and _has_luigid():
        _log.warning("This command requests no more tasks from luigid. It ends after its builds.")
        os.kill(int(_own_command()[1]), signal.SIGUSR1)


def reenable_failed_tasks(tasks: Callable[[], Iterable[luigi.Task]]) -> None:
    """Enables tasks of this command that failed in earlier ones, which luigid disables for a day.

    Args:
        tasks: Returns all tasks of the command; called only if luigid has disabled any task.
    """
    if not _has_luigid():
        return
    with contextlib.suppress(RPCError):
        scheduler = _scheduler()
        disabled = scheduler.task_list("DISABLED", "", limit=False)
        own = {task.task_id for task in tasks()} if disabled else set()
        for task_id in own.intersection(disabled):
            scheduler.re_enable_task(task_id)


def is_forgotten_by_luigid() -> bool:
    """Returns whether luigid was restarted and no longer knows this command.

    It then answers the worker that there is no work, and the worker ends.
    """
    if not _has_luigid():
        return False
    with contextlib.suppress(RPCError), _one_attempt():  # the worker has already waited for luigid
        return not _knows(_scheduler(), *_own_command())
    return False


@contextlib.contextmanager
def _one_attempt() -> Iterator[None]:
    """Limits requests to one attempt, for a scheduler that does not answer."""
    config, option = luigi.configuration.get_config(), ("core", "rpc-retry-attempts")  # type: ignore[no-untyped-call]
    before = config.get(*option, "3")
    config.set(*option, "1")
    try:
        yield
    finally:
        config.set(*option, before)


def _scheduler() -> Any:
    return RemoteScheduler(luigi.interface.core().scheduler_url)  # type: ignore[no-untyped-call]


def _has_luigid() -> bool:
    return not luigi.interface.core().local_scheduler  # type: ignore[no-untyped-call]


def _own_command() -> tuple[str, str]:
    """Returns the name of this host and the id of the command's main process."""
    command = multiprocessing.parent_process()
    return socket.gethostname(), str((command and command.pid) or os.getpid())


def _is_running(scheduler: Any, host: str, pid: str) -> bool:
    """Returns whether a command is running; luigid knows it of commands on other hosts."""
    if host == socket.gethostname():
        return bool(psutil.pid_exists(int(pid)))
    return _knows(scheduler, host, pid)


def _knows(scheduler: Any, host: str, pid: str) -> bool:
    """Returns whether luigid knows the worker of a command."""
    workers = scheduler.worker_list(include_running=False)
    return (host, pid) in [(w.get("host"), str(w.get("pid"))) for w in workers]
