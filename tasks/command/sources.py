"""The sources of a command: stages that need no other one, and read or fetch what the user names.

A command ends before its first stage where a source names what is not there. Sources run first, one
file before a folder or a video; where one fails, nothing after it begins, since the results of
hours would lack it. With `--keep-going` the command makes all stages that do not need it. Under
luigid it does so, too: another machine may read a source that this one cannot.
"""

import functools
import multiprocessing
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime

import luigi
import psutil

from pipeline.errors import TaskFailure
from pipeline.maintenance.task_graph import stored_tasks
from pipeline.task import StoredTask
from styletrf.errors import InputError
from tasks.command.outcomes import outcome_of_missing

SOURCE_PRIORITY = 10**9
"""What one rank adds to a priority, in seconds: more than any command takes."""

_RANKS = {
    "StyleImage": 6,
    "StyleNetwork": 5,  # one that the user gives
    "TransferWeights": 4,
    "PerceptualWeights": 3,
    "SceneCapture": 2,
    "ContentImages": 1,
}
"""Of sources. Earlier builds do not decide them: a first command has none."""


def is_source(stage: luigi.Task) -> bool:
    """Returns whether the stage needs no other one."""
    return not luigi.task.flatten(stage.requires())  # type: ignore[no-untyped-call]


def source_rank(stage: luigi.Task) -> int:
    """Returns the rank of a source, which is larger the sooner it runs; 0 for other stages."""
    return _RANKS.get(stage.task_family, 1) if is_source(stage) else 0


@functools.cache
def sources_of(root: luigi.Task) -> Sequence[StoredTask]:
    """Returns the sources of a command."""
    return [task for task in stored_tasks(root) if is_source(task)]


def unreadable_sources(root: luigi.Task) -> Iterator[str]:
    """Yields what is wrong with sources that name what is not there, if the command stops there.

    Digests of what is there are kept for the keys of the sources.
    """
    for source in sources_of(root) if may_stop(root) else ():
        try:
            source.action()
        except InputError as error:
            yield str(error)
        except OSError:  # the stage of the source reports it
            continue


def require_sources(stage: StoredTask, root: luigi.Task | None) -> None:
    """Stops a stage of a command of which a source before it failed.

    Args:
        stage: The stage that is about to run.
        root: The task of the command, which stops if it has a `keep_going` that was not given; None
            outside a command.

    Raises:
        TaskFailure: A source of a higher rank failed since the command began, and `--keep-going`
            was not given.
    """
    if root is None or not may_stop(root):
        return
    begun, rank = begin_of_command(), source_rank(stage)
    for source in (each for each in sources_of(root) if source_rank(each) > rank):
        found = outcome_of_missing(source, since=begun)
        if found.outcome == "failed":
            reason = f"skipped because {found.stage} failed. Add --keep-going to build it anyway."
            raise TaskFailure("user", str(stage), reason)


def may_stop(root: luigi.Task) -> bool:
    """Returns whether a command stops where an input is missing.

    It does if it has a `keep_going` that was not given, and no luigid hands its stages to others.
    """
    return not getattr(root, "keep_going", True) and builds_alone()


def builds_alone() -> bool:
    """Returns whether no luigid hands the stages of the command to several machines."""
    return bool(luigi.interface.core().local_scheduler)  # type: ignore[no-untyped-call]


def begin_of_command() -> datetime:
    """Returns when the command began, of which this process is or works for."""
    command = multiprocessing.parent_process()
    process = psutil.Process(command.pid if command else None)
    return datetime.fromtimestamp(process.create_time(), UTC)
