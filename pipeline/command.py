"""One command from start to end: what happens before and after Luigi runs its tasks.

A package of tasks calls `run_command` in its `__main__`. It calls `take_over_luigi` when it is
imported, so that `luigi --module PACKAGE ...` calls `run_command`, too.
"""

import importlib
import logging
import sys
from collections.abc import Callable, Sequence
from configparser import ConfigParser
from datetime import datetime
from pathlib import Path

import luigi
from luigi.cmdline import luigi_run
from luigi.cmdline_parser import CmdlineParser
from luigi.execution_summary import LuigiStatusCode
from luigi.interface import PidLockAlreadyTakenExit
from luigi.parameter import MissingParameterException, ParameterException
from luigi.retcodes import retcode
from luigi.setup_logging import InterfaceLogging
from luigi.task_register import Register, TaskClassException

from pipeline.cluster.backends import BACKENDS
from pipeline.cluster.luigid import is_forgotten_by_luigid, reenable_failed_tasks
from pipeline.console.display import open_closed_stderr
from pipeline.console.log_handler import in_one_line
from pipeline.console.progress_client import close_progress, progress_client
from pipeline.errors import StoreError
from pipeline.execution.executors import EXECUTORS
from pipeline.execution.fork_server import fork_server
from pipeline.maintenance.task_graph import upstream_first
from pipeline.parameters import parameter_errors
from pipeline.settings import (
    BOOLEANS,
    DEFAULTS,
    boolean_setting,
    data_root,
    invalid_setting,
    number_setting,
    setting,
)

_log = logging.getLogger("pipeline")
_luigi_log = logging.getLogger("luigi-interface")
_PACKAGE = Path(__file__).parent
_ADDRESSES = "scheduler_url", "scheduler_host", "default_scheduler_url", "default_scheduler_host"
"""Options by which a user names a luigid."""
INVALID = 1
"""The exit status of a command that is invalid or refused."""
INTERRUPTED = 130
"""The exit status after Ctrl-C, as in shells."""
Begin = Callable[[luigi.Task], None]
"""Called with the task of the command before Luigi runs it; SystemExit ends the command."""
End = Callable[[luigi.Task], int | None]
"""Called with the task at the end; returns the exit status, or None for Luigi's.

After Ctrl-C the status is `INTERRUPTED`, whatever it returns.
"""


def run_command(
    arguments: Sequence[str], begin: Begin, end: End, libraries: Sequence[str] = ()
) -> int:
    """Runs a command; returns its exit status.

    It calls `end` whether the task was made, failed or was interrupted by Ctrl-C. If luigid was
    restarted and no longer knows the command, Luigi runs again for the missing tasks.

    Args:
        arguments: The task and its parameters, as the command line of Luigi.
        begin: Called first. If it ends the command, `end` is not called.
        end: Called last.
        libraries: Modules that are imported once for all builds and `begin`, see `fork_server`.

    Raises:
        SystemExit: The command is invalid, or prints its help.
    """
    open_closed_stderr()
    _complete_settings()
    try:
        with CmdlineParser.global_instance(list(arguments)) as parser:  # or prints help
            _require_valid_settings()
            _require_settings_or_data()
            _require_readable_options(parser)
            _use_named_luigid(parser)
            InterfaceLogging.setup(luigi.interface.core())  # type: ignore[no-untyped-call]
            with parameter_errors():
                return _run(parser, begin, end, libraries)
    except KeyboardInterrupt:
        return _interrupted()
    except (TaskClassException, ParameterException) as error:
        sys.stderr.write(f"{in_one_line(error)}\n")
        return INVALID


def take_over_luigi(module: str) -> None:
    """Runs the command here if the main program is Luigi's command line; returns if it is not.

    Luigi imports a package to run its command, and has no hooks before and after the command
    (`docs/decisions/0032-the-place-around-luigi.md`).

    Args:
        module: The module whose `run` runs a command. It is given by its name, so that the code
            of commands does not count as code of the stages.

    Raises:
        SystemExit: With the status of the command.
    """
    if getattr(sys.modules["__main__"], "luigi_run", None) is luigi_run:
        sys.exit(importlib.import_module(module).run(sys.argv[1:]))


def _run(parser: CmdlineParser, begin: Begin, end: End, libraries: Sequence[str]) -> int:
    try:
        with parameter_errors():
            task = parser.get_task_obj()  # type: ignore[no-untyped-call]
    except MissingParameterException:
        sys.stderr.write(f"{_missing_in_words(parser)}\n")
        return INVALID
    except ParameterException:
        raise
    except Exception:  # noqa: BLE001  every error is reported
        _luigi_log.exception("The command cannot be read")
        return int(retcode().unhandled_exception)  # type: ignore[no-untyped-call]
    with fork_server(libraries):
        begin(task)
        reenable_failed_tasks(lambda: upstream_first(task))
        progress_client()  # before workers are forked
        status = _luigi_status(task)
        while status != INTERRUPTED and _is_to_run_again(task):
            status = _luigi_status(task)
    close_progress()
    own = end(task)
    return status if own is None or status == INTERRUPTED else own


def _missing_in_words(parser: CmdlineParser) -> str:
    """Returns the missing parameters of a command, with their descriptions."""
    given, family = parser.known_args, parser.known_args.root_task
    missing = [
        f"--{name.replace('_', '-')}" + f" ({parameter.description})" * bool(parameter.description)
        for name, parameter in Register.get_task_cls(family).get_params()  # type: ignore[no-untyped-call]
        if not getattr(given, name, None) and not parameter.has_task_value(family, name)
    ]
    return f"{family} needs {', '.join(missing)}."


def _require_readable_options(parser: CmdlineParser) -> None:
    """Refuses a value of Luigi's own options, such as `--workers`, that is of another type.

    Raises:
        SystemExit: It names the option and the value.
    """
    for name, parameter in luigi.interface.core.get_params():  # type: ignore[no-untyped-call]
        option = name.replace("_", "-")
        try:
            parameter.task_value("core", name)
        except ValueError as error:
            value = getattr(parser.known_args, f"core_{name}", None)
            place = f"[core] {name} in luigi.cfg" if value is None else f"--{option} {value}"
            raise SystemExit(f"{place}: {error}. `luigi --help-all` explains it.") from error


def _require_valid_settings() -> None:
    """Refuses a setting of the pipeline of another kind than its default, and unknown executors.

    It reads all settings, so that none fails at the end of a long command.

    Raises:
        SystemExit: It names the setting and, if that can be read, the value.
    """
    try:
        for (section, name), default in DEFAULTS.items():
            if default.isdigit():
                number_setting(section, name)
            elif default in BOOLEANS:
                boolean_setting(section, name)
            else:
                setting(section, name)
        if setting("store", "executor") not in (known := [*EXECUTORS, *BACKENDS]):
            raise invalid_setting("store", "executor", f"one of {', '.join(known)}")
    except StoreError as error:
        raise SystemExit(str(error)) from error


def _use_named_luigid(parser: CmdlineParser) -> None:
    """Uses the luigid that an option of the command names, although `luigi.cfg` has none."""
    given = vars(parser.known_args)
    is_named = given["core_scheduler_url"] or given["core_scheduler_host"]
    if is_named and not given["core_local_scheduler"]:
        config = luigi.configuration.get_config()  # type: ignore[no-untyped-call]
        config.set("core", "local_scheduler", "false")


def _luigi_status(task: luigi.Task) -> int:
    """Runs the task with Luigi; returns the exit status, by `[retcode]` of `luigi.cfg`."""
    statuses = retcode()  # type: ignore[no-untyped-call]
    core = luigi.interface.core()  # type: ignore[no-untyped-call]
    try:
        result = luigi.build(  # type: ignore[no-untyped-call]
            [task], detailed_summary=True, no_lock=core.no_lock
        )
    except KeyboardInterrupt:
        return _interrupted()
    except PidLockAlreadyTakenExit:
        return int(statuses.already_running)
    except Exception:  # noqa: BLE001  for example, luigid does not answer
        _luigi_log.exception("Luigi failed")
        return int(statuses.unhandled_exception)
    is_there = core.local_scheduler or task.complete()  # type: ignore[no-untyped-call]
    return {
        LuigiStatusCode.SUCCESS: 0 if is_there else int(statuses.not_run),
        LuigiStatusCode.SUCCESS_WITH_RETRY: 0 if is_there else int(statuses.not_run),
        LuigiStatusCode.FAILED: int(statuses.task_failed),
        LuigiStatusCode.FAILED_AND_SCHEDULING_FAILED: int(statuses.scheduling_error),
        LuigiStatusCode.SCHEDULING_FAILED: int(statuses.scheduling_error),
        LuigiStatusCode.NOT_RUN: int(statuses.not_run),
        LuigiStatusCode.MISSING_EXT: int(statuses.missing_data),
    }[result.status]


def _interrupted() -> int:
    sys.stderr.write("\nInterrupted. Run the same command again to continue.\n")
    return INTERRUPTED


def _is_to_run_again(task: luigi.Task) -> bool:
    """Whether luigid was restarted, something is missing, and the deadline has not passed."""
    if not is_forgotten_by_luigid():
        return False
    until = getattr(task, "until", None)
    has_time = until is None or datetime.now(until.tzinfo) < until
    if not has_time or task.complete():  # type: ignore[no-untyped-call]
        return False
    _log.warning("luigid was restarted. Requesting all missing tasks again.")
    return True


def _require_settings_or_data() -> None:
    """Refuses a command in a folder with neither settings nor data: it would leave a store there.

    Raises:
        SystemExit: There is no section [store], and no folder of data.
    """
    config = luigi.configuration.get_config()  # type: ignore[no-untyped-call]
    if not config.has_section("store") and not data_root().is_dir():
        raise SystemExit(
            f"There is no luigi.cfg with a section [store] in {Path.cwd()}, and no {data_root()}."
            " Run the command in the root of the repository, or in a folder with your data/."
        )


def _complete_settings() -> None:
    """Gives Luigi this project's settings of it, where the user has no others.

    Luigi reads `luigi.cfg` in the working directory. A folder of an installed package has none, or
    one with the user's settings alone, so a copy of the repository's lies in this package. The
    user's address of a luigid means that the user has one.
    """
    config = luigi.configuration.get_config()  # type: ignore[no-untyped-call]
    ours = ConfigParser()
    ours.read(_PACKAGE / "luigi.cfg", encoding="utf-8")
    if any(config.has_option("core", name) for name in _ADDRESSES):
        ours.remove_option("core", "local_scheduler")
    for section in ("core", "worker", "scheduler", "retcode"):
        for name, value in ours.items(section):
            if not config.has_option(section, name):
                config.set(section, name, value)
    if config.get("core", "logging_conf_file") == ours.get("core", "logging_conf_file"):
        config.set("core", "logging_conf_file", str(_PACKAGE / "logging.cfg"))
