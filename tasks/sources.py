"""The sources of a command: stages that need no other one, and read or fetch what the user names.

They take seconds, so they run first; where one fails, the command stops, since what the other
stages make in hours would lack it. With `--keep-going` all that does not need it is made.
"""

import functools
import multiprocessing
from collections.abc import Sequence
from datetime import UTC, datetime

import luigi
import psutil

from pipeline.attempts import obstacle
from pipeline.errors import TaskFailure
from pipeline.settings import current_store
from pipeline.task import StoredTask
from tasks.graph import graph

FIRST = 10**9
"""Added to the priority of a source: more than the seconds of any command."""


def is_source(stage: luigi.Task) -> bool:
    """Whether the stage needs no other one."""
    return not luigi.task.flatten(stage.requires())  # type: ignore[no-untyped-call]


@functools.cache
def sources_of(root: luigi.Task) -> Sequence[StoredTask]:
    """Returns the sources of a command."""
    return [task for task in graph(root) if isinstance(task, StoredTask) and is_source(task)]


def require_sources(stage: StoredTask, root: luigi.Task | None) -> None:
    """Stops a stage of a command of which a source failed.

    Args:
        stage: That is about to run.
        root: What the command asks for; None where no command does.

    Raises:
        TaskFailure: A source failed since the command began, and `--keep-going` was not given.
    """
    if root is None or getattr(root, "keep_going", False) or is_source(stage):
        return
    for source in sources_of(root):
        problem = obstacle(source, current_store(), since=begin_of_command())
        if problem and not problem.is_under_way:
            reason = f"not begun, for {problem.task} failed. --keep-going begins it all the same."
            raise TaskFailure("user", str(stage), reason)


def begin_of_command() -> datetime:
    """Returns when the command began, of which this process is or works for."""
    command = multiprocessing.parent_process()
    process = psutil.Process(command.pid if command else None)
    return datetime.fromtimestamp(process.create_time(), UTC)
