"""`python -m pipeline COMMAND`: lists, checks, repairs, shares and cleans the store."""

import argparse
import json
import math
import os
import sys
from collections.abc import Callable
from typing import Any

from pipeline.console.display import open_closed_stderr
from pipeline.errors import StoreError
from pipeline.maintenance import code_commands, commands, store_commands
from pipeline.maintenance.commands import CommandResult, Rows
from pipeline.settings import current_store
from pipeline.store import Store

_CODE_COMMANDS = ("snapshot", "adopt")


class _FormerGrid(argparse.Action):
    """The name of `--grid` in earlier versions."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options | {"default": argparse.SUPPRESS})

    def __call__(self, _parser: object, options: object, value: object, _name: object = "") -> None:
        """Warns, and sets the option."""
        sys.stderr.write("--night is now called --grid; --night will be removed.\n")
        setattr(options, self.dest, value)


def main(arguments: list[str] | None = None) -> int:
    """Runs one command; returns its exit status.

    It is 0, 1 if the command found a problem, 2 if it is invalid, and 130 after Ctrl-C.
    """
    open_closed_stderr()
    options = parser().parse_args(arguments)
    try:
        store = _store(options.command)
        status, rows = options.run(store, options)
        sys.stdout.write(json.dumps(rows, indent=1) + "\n" if options.json else _table(rows))
        sys.stdout.flush()
    except BrokenPipeError:  # such as `| head`; Python's last flush must not fail either
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 1
    except (StoreError, OSError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write("\nInterrupted.\n")
        return 130
    return int(status)


def _store(command: str) -> Store | None:
    """Returns the store, if the command needs it; only `pull` creates one."""
    return None if command in _CODE_COMMANDS else current_store(create=command == "pull")


def parser() -> argparse.ArgumentParser:
    """Returns the parser of all commands and their options."""
    parser = argparse.ArgumentParser(prog="python -m pipeline", description=__doc__)
    subparsers = parser.add_subparsers(dest="command", required=True)

    def command(run: Callable[..., CommandResult], **positional: Any) -> Callable[..., Any]:
        """Adds a command with its function's name and docstring; returns its `add_argument`."""
        description = str(run.__doc__)
        added = subparsers.add_parser(
            run.__name__, help=description.partition(".")[0], description=description
        )
        added.set_defaults(run=run)
        added.add_argument("--json", action="store_true", help="prints JSON")
        for name, arguments in positional.items():
            added.add_argument(name, **arguments)
        return added.add_argument

    digits = "first digits of a key or of a digest"
    option = command(commands.ls, family={"nargs": "?", "help": "lists this task only"})
    option("--failed", action="store_true", help="lists the logs of attempts without an artifact")
    command(commands.show, address={"help": digits})
    command(commands.du)
    option = command(store_commands.verify)
    option("--deep", action="store_true", help="reads every byte")
    option("--repair", action="store_true", help="restores or sets aside what is damaged")
    option = command(store_commands.gc)
    option("--delete", action="store_true", help="deletes the garbage")
    option("--keep-last", type=_count, default=3, metavar="N", help="finished runs to keep (3)")
    option("--grace", type=_hours, default=24.0, metavar="HOURS", help="keeps newer files (24)")
    option = command(store_commands.pin, address={"nargs": "?", "help": digits})
    option("--name", help="name of the pin")
    command(
        store_commands.unpin,
        name={"help": "name in the list of `pin`, or a folder that shows results"},
    )
    command(store_commands.push, address={"nargs": "*", "help": f"{digits}; none: all artifacts"})
    option = command(store_commands.pull, address={"nargs": "*", "help": digits})
    option("--grid", default="", metavar="NAME", help="fetches from the list of this grid only")
    option("--night", dest="grid", action=_FormerGrid, help=argparse.SUPPRESS)
    option("--closure", action="store_true", help="also fetches everything they were made from")
    of_module = {"default": "tasks", "help": "package of the tasks (tasks)"}
    task = {"nargs": "...", "help": "as for Luigi: TASK --parameter value ..."}
    command(code_commands.why, task=task)("--module", **of_module)
    command(code_commands.snapshot)("--module", **of_module)
    family = {"nargs": "+", "help": "tasks with unchanged results"}
    option = command(code_commands.adopt, family=family)
    option("--reason", required=True, help="reason for readers of the snapshot")
    option("--module", **of_module)
    return parser


def _count(text: str) -> int:
    """Parses a whole number of 0 or more."""
    return int(_hours(str(int(text))))


def _hours(text: str) -> float:
    """Parses a finite number of 0 or more."""
    if not 0 <= float(text) < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not 0 or more")
    return float(text)


def _table(rows: Rows) -> str:
    """Returns aligned columns, with readable units for sizes and times."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    lines = [[name.removesuffix("_bytes") for name in names]]
    lines += [[_cell(name, row.get(name)) for name in names] for row in rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(names))]
    padded = ([c.ljust(width) for c, width in zip(line, widths, strict=True)] for line in lines)
    return "".join("  ".join(line).rstrip() + "\n" for line in padded if line)


def _cell(name: str, value: object) -> str:
    match value:
        case None:
            return ""
        case int() | float() if name.endswith("bytes"):
            return f"{value / 1e6:9.1f} MB"
        case float() if name == "seconds":
            return f"{value:8.1f}"
        case str():
            return value[:12] if name in ("key", "digest") else value
    return json.dumps(value)
