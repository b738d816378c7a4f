"""`python -m pipeline COMMAND`: what the store holds, why, and keeping it whole and small."""

import argparse
import json
import sys

from pipeline import code_commands, commands
from pipeline.commands import Rows
from pipeline.errors import StoreError
from pipeline.settings import current_store
from pipeline.store import Store

_OF_CODE_ALONE = ("snapshot", "adopt")


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns its exit status: 0, 1 where something is amiss, 2 for misuse."""
    options = _parser().parse_args(arguments)
    try:
        store = _store(options.command)
        status, rows = options.run(store, options)
    except (StoreError, OSError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    sys.stdout.write(json.dumps(rows, indent=1) + "\n" if options.json else _table(rows))
    return int(status)


def _store(command: str) -> Store | None:
    """The store, for those that look into it; only `pull` makes one where there is none."""
    return None if command in _OF_CODE_ALONE else current_store(create=command == "pull")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m pipeline", description=__doc__)
    subparsers = parser.add_subparsers(dest="command", required=True)
    every = {**commands.COMMANDS, **code_commands.COMMANDS}
    for name, (run, explanation, parameters) in every.items():
        command = subparsers.add_parser(name, help=explanation, description=explanation)
        command.add_argument("--json", action="store_true", help="for programs")
        for flags, settings in parameters.items():
            command.add_argument(*flags.split(), **settings)
        command.set_defaults(run=run)
    return parser


def _table(rows: Rows) -> str:
    """Aligned columns; sizes and times in units that a person reads."""
    if not rows:
        return ""
    names = list(dict.fromkeys(name for row in rows for name in row))
    lines = [[name.removesuffix("_bytes") for name in names]]
    lines += [[_cell(name, row.get(name)) for name in names] for row in rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(names))]
    return "".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        + "\n"
        for line in lines
    )


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


if __name__ == "__main__":
    sys.exit(main())
