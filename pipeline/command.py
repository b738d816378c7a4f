"""One command from first to last: what happens before and after Luigi runs its tasks.

`run_command` is the only place for either. A package of tasks calls it in its `__main__`, and calls
`take_over_luigi` when it is imported, so that `luigi --module PACKAGE ...` reaches it, too.
"""

import contextlib
import importlib
import logging
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from datetime import datetime
from pathlib import Path

import luigi
from luigi.cmdline import luigi_run
from luigi.cmdline_parser import CmdlineParser
from luigi.retcodes import run_with_retcodes

from pipeline.cluster.luigid import is_forgotten_by_luigid, reenable_failed_tasks
from pipeline.console.log_handler import in_one_line, is_for_users
from pipeline.console.progress_client import close_progress, progress_client
from pipeline.maintenance.why import upstream_first

_log = logging.getLogger("pipeline")
INTERRUPTED = 130
"""The exit status after Ctrl-C, as shells have it."""
Begin = Callable[[luigi.Task], None]
"""Called with the task of the command before Luigi runs it; SystemExit ends the command."""
End = Callable[[luigi.Task], int | None]
"""Called with the task when all else is done; returns the exit status, or None for Luigi's."""


def run_command(arguments: Sequence[str], begin: Begin, end: End) -> int:
    """Runs a command; returns its exit status.

    It ends with `end`, whether the task was made, failed, or was interrupted by Ctrl-C. If luigid
    was restarted meanwhile and has forgotten the command, Luigi is run again for what is missing.

    Args:
        arguments: The task and its parameters, as the command line of Luigi.
        begin: Called first. A command that it ends does not reach `end`.
        end: Called last.

    Raises:
        SystemExit: The command is refused, or prints a help.
    """
    words = list(arguments)
    _require_configuration()
    try:
        with _task_of(words) as task:
            if task is not None:
                begin(task)
                reenable_failed_tasks(lambda: [task, *upstream_first(task)])
                progress_client()  # before workers are forked
        status = _luigi_status(words)
        while status != INTERRUPTED and _is_to_run_again(words):
            status = _luigi_status(words)
        close_progress()
        with _task_of(words) as task:
            own = end(task) if task is not None else None
    except KeyboardInterrupt:
        return _interrupted()
    except Exception as error:
        if not is_for_users(error):
            raise
        sys.stderr.write(f"{in_one_line(error)}\n")
        return 1
    return status if own is None else own


def take_over_luigi(module: str) -> None:
    """Runs the command here if the main program is Luigi's command line; returns if it is not.

    Luigi imports a package to run a command of it, and has no place for what comes before and
    after (`docs/decisions/0032-the-place-around-luigi.md`).

    Args:
        module: The module whose `run` runs a command. It is given by its name, so that the code
            of commands does not count as code of the stages.

    Raises:
        SystemExit: With the status of the command.
    """
    if getattr(sys.modules["__main__"], "luigi_run", None) is luigi_run:
        sys.exit(importlib.import_module(module).run(sys.argv[1:]))


@contextlib.contextmanager
def _task_of(words: list[str]) -> Iterator[luigi.Task | None]:
    """The task of a command, its parameters in force; None if Luigi will refuse them."""
    with CmdlineParser.global_instance(words) as parser:
        try:
            task = parser.get_task_obj()
        except Exception:  # noqa: BLE001  Luigi meets it again and reports it
            task = None
        yield task


def _luigi_status(words: list[str]) -> int:
    """Has Luigi run the command; returns the exit status."""
    try:
        run_with_retcodes(words)  # type: ignore[no-untyped-call]
    except SystemExit as ended:
        if ended.code is None or isinstance(ended.code, int):
            return ended.code or os.EX_OK
        raise
    except KeyboardInterrupt:
        return _interrupted()
    return os.EX_OK


def _interrupted() -> int:
    sys.stderr.write("\nInterrupted. The same command goes on from here.\n")
    return INTERRUPTED


def _is_to_run_again(words: list[str]) -> bool:
    """Whether luigid was restarted, something is missing, and the deadline has not passed."""
    with _task_of(words) as task:
        if task is None or not is_forgotten_by_luigid():
            return False
        until = getattr(task, "until", None)
        has_time = until is None or datetime.now(until.tzinfo) < until
        is_to_run = has_time and not task.complete()  # type: ignore[no-untyped-call]
    if is_to_run:
        _log.warning("luigid was restarted. Requesting all that is missing again.")
    return bool(is_to_run)


def _require_configuration() -> None:
    """Refuses a command without settings, before Luigi looks for a scheduler.

    Luigi reads `luigi.cfg` in the working directory only, and needs none.

    Raises:
        SystemExit: There is no section [store].
    """
    config = luigi.configuration.get_config()  # type: ignore[no-untyped-call]
    if not config.has_section("store"):
        raise SystemExit(
            f"There is no luigi.cfg with a section [store] in {Path.cwd()}."
            " Run from the folder of the repository."
        )
