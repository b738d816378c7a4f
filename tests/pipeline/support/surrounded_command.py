"""A command of toys that says what it calls: `python -m surrounded_command REFUSAL STATUS ...`.

Its begin ends it with the refusal, if that is not empty; its end returns the status, in JSON.
"""

import json
import sys

import build_toys  # noqa: F401
import luigi
import store_toys  # noqa: F401

from pipeline.command import run_command

REFUSAL, STATUS = sys.argv[1], json.loads(sys.argv[2])


def begin(task: luigi.Task) -> None:
    print("begin", task.task_family, flush=True)  # noqa: T201
    if REFUSAL:
        raise SystemExit(REFUSAL)


def end(task: luigi.Task) -> int | None:
    print("end", "complete" if task.complete() else "incomplete", flush=True)  # noqa: T201
    return STATUS


if __name__ == "__main__":
    sys.exit(run_command(sys.argv[3:], begin, end))
