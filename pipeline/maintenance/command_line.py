"""`python -m pipeline COMMAND`: what the store holds, why, and keeping it whole and small."""

import argparse
import json
import math
import os
import sys
from collections.abc import Callable
from typing import Any

from pipeline.errors import StoreError
from pipeline.maintenance import code_commands, commands, store_commands
from pipeline.maintenance.commands import Answer, Rows
from pipeline.settings import current_store
from pipeline.store import Store

_OF_CODE_ALONE = ("snapshot", "adopt")


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns its exit status: 0, 1 where something is amiss, 2 for misuse."""
    options = _parser().parse_args(arguments)
    try:
        store = _store(options.command)
        status, rows = options.run(store, options)
        sys.stdout.write(json.dumps(rows, indent=1) + "\n" if options.json else _table(rows))
        sys.stdout.flush()
    except BrokenPipeError:  # `| head`: nobody wants the rest, nor Python's flush at the end
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 1
    except (StoreError, OSError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return int(status)


def _store(command: str) -> Store | None:
    """The store, for those that look into it; only `pull` makes one where there is none."""
    return None if command in _OF_CODE_ALONE else current_store(create=command == "pull")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m pipeline", description=__doc__)
    subparsers = parser.add_subparsers(dest="command", required=True)

    def command(run: Callable[..., Answer], **positional: Any) -> Callable[..., Any]:
        """Adds a command named and explained as its function; returns what adds its options."""
        description = str(run.__doc__)
        added = subparsers.add_parser(
            run.__name__, help=description.partition(".")[0], description=description
        )
        added.set_defaults(run=run)
        added.add_argument("--json", action="store_true", help="for programs")
        for name, arguments in positional.items():
            added.add_argument(name, **arguments)
        return added.add_argument

    begins = "first digits of a key or of a digest"
    option = command(commands.ls, family={"nargs": "?", "help": "only of this task"})
    option("--failed", action="store_true", help="logs of attempts that left none")
    command(commands.show, address={"help": begins})
    command(commands.du)
    option = command(store_commands.verify)
    option("--deep", action="store_true", help="read every byte")
    option("--repair", action="store_true", help="from the shared store, or set aside")
    option = command(store_commands.gc)
    option("--delete", action="store_true", help="do it")
    option("--keep-last", type=_count, default=3, metavar="N", help="runs (3)")
    option("--grace", type=_hours, default=24.0, metavar="HOURS", help="(24)")
    option = command(store_commands.pin, address={"nargs": "?", "help": begins})
    option("--name", help="what to call it")
    command(
        store_commands.unpin,
        name={"help": "as `pin` lists it, or a folder that shows results"},
    )
    command(store_commands.push, address={"nargs": "*", "help": f"{begins}; none: all"})
    option = command(store_commands.pull, address={"nargs": "*", "help": begins})
    option("--night", default="", help="of those on a grid's list alone, without names: all of it")
    option("--closure", action="store_true", help="with all that they were made from")
    of_module = {"default": "tasks", "help": "the package of the tasks (tasks)"}
    task = {"nargs": "...", "help": "as Luigi takes it: TASK --parameter value ..."}
    command(code_commands.why, task=task)("--module", **of_module)
    command(code_commands.snapshot)("--module", **of_module)
    family = {"nargs": "+", "help": "the tasks for which it is so"}
    option = command(code_commands.adopt, family=family)
    option("--reason", required=True, help="why it is so, for who reads the snapshot")
    option("--module", **of_module)
    return parser


def _count(word: str) -> int:
    """A number of things, 0 or more."""
    return int(_hours(str(int(word))))


def _hours(word: str) -> float:
    """A time of 0 or more that ends."""
    if not 0 <= float(word) < math.inf:
        raise argparse.ArgumentTypeError(f"{word} is not 0 or more")
    return float(word)


def _table(rows: Rows) -> str:
    """Aligned columns; sizes and times in units that a person reads."""
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
