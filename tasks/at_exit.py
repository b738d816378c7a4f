"""What a command still does when all else is done, however that went."""

import functools
import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime

import luigi
from luigi.cmdline_parser import CmdlineParser
from luigi.task_register import Register

from pipeline.cluster.luigid import is_forgotten_by_luigid, reenable_failed_tasks
from pipeline.exit_hooks import register_exit_hook, restart_process, was_interrupted
from tasks.graph import graph

screen = logging.getLogger("pipeline")


def at_exit(act: Callable[[], None]) -> Callable[[], None]:
    """Has this process, not its workers, do something at its end, with the command's parameters.

    What was asked for first is done last.

    Returns:
        What takes it back.
    """
    parameters = _command_parameters()

    def run() -> None:
        _adopt(parameters)  # Luigi has forgotten the command line by then
        act()

    return register_exit_hook(run)


@contextmanager
def acting_at_exit(task: luigi.Task, act: Callable[[luigi.Task], None]) -> Iterator[None]:
    """Has the command that asks for this task act on it at its end, once, done or failed.

    What failed for earlier commands luigid lets it try again. If by the end luigid has forgotten
    the command, it begins again instead, until its time is over. Not if the command is refused
    within the block. Of other commands than its own this does nothing.
    """
    take_back = _ask_for(task, act) if root_of_command() == task else None
    try:
        yield
    except SystemExit:
        if take_back:
            take_back()
        raise
    if take_back:
        _try_again(task)


@functools.cache
def _try_again(task: luigi.Task) -> None:
    """Once a command, for all that it asks for."""
    reenable_failed_tasks(functools.partial(graph, task))


@functools.cache
def _ask_for(task: luigi.Task, act: Callable[[luigi.Task], None]) -> Callable[[], None]:
    return at_exit(functools.partial(_end, task, act))


def _end(task: luigi.Task, act: Callable[[luigi.Task], None]) -> None:
    if not was_interrupted() and is_forgotten_by_luigid() and _is_to_go_on(task):
        screen.warning("luigid was restarted, and knows of nothing to do. Asking again for all.")
        restart_process()
    act(task)


def _is_to_go_on(task: luigi.Task) -> bool:
    """Whether something is missing, and the deadline has not passed."""
    until = getattr(task, "until", None)
    has_time = until is None or datetime.now(until.tzinfo) < until
    return has_time and not task.complete()  # type: ignore[no-untyped-call]


def root_of_command() -> luigi.Task | None:
    """Returns the task that the command of this process asks for, if it is a command's."""
    command = CmdlineParser.get_instance()  # type: ignore[no-untyped-call]
    return command.get_task_obj() if command else None


def _command_parameters() -> dict[str, dict[str, str]]:
    """What the command line says of any family of tasks, as `--Family-name value`, by family."""
    parser = CmdlineParser.get_instance()  # type: ignore[no-untyped-call]
    given = vars(parser.known_args) if parser else {}
    parameters: dict[str, dict[str, str]] = {}
    known = Register.get_all_params()  # type: ignore[no-untyped-call]
    for family, _, name, _ in known:
        if value := given.get(f"{family}_{name}"):  # False is a flag that was not given
            parameters.setdefault(family, {})[name] = str(value)
    return parameters


def _adopt(parameters: Mapping[str, Mapping[str, str]]) -> None:
    """Make another process's `_command_parameters` the defaults in this one."""
    config = luigi.configuration.get_config()  # type: ignore[no-untyped-call]
    for family, values in parameters.items():
        for name, value in values.items():
            config.set(family, name, value.replace("%", "%%"))
