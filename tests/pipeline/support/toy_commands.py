"""What a command of toys does before Luigi and after."""

import sys
from collections.abc import Sequence

import luigi
from build_toys import Steps

from pipeline.command import run_command


def begin(task: luigi.Task) -> None:
    """Nothing."""


def end(task: luigi.Task) -> None:
    """Looks at several steps."""
    if isinstance(task, Steps):
        sys.stderr.write("whole\n" if task.complete() else "in part\n")


def run(arguments: Sequence[str]) -> int:
    return run_command(arguments, begin, end)
