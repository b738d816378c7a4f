"""Commands of this package, run for their exit status and their output."""

import os
import runpy
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryFile

from pipeline.execution.fork_server import current_fork_server

ROOT = Path(__file__).parents[3]
CELL = ["--scene", "mini", "--style", "p"]
_LONGEST_S = 300


def said(photographs: Path, *words: str) -> tuple[int, str]:
    """Exit status and screen of a command on the mini scene, where no GPU can be seen."""
    environment = {"STYLETRF_DATA": str(photographs), "CUDA_VISIBLE_DEVICES": ""}
    done = command("--module", "tasks", *words, "--content", "embedded", **environment)
    return done.returncode, done.stdout + done.stderr


def command(*words: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    """Runs `python -m luigi` with these words and further variables.

    Its interpreter is forked from one that has imported the libraries, and imports the project.
    """
    with TemporaryFile("w+") as out, TemporaryFile("w+") as err, Path(os.devnull).open() as nothing:
        streams = nothing.fileno(), out.fileno(), err.fileno()
        process = current_fork_server().start(
            "command_output:luigi", words, os.environ | environment, streams
        )
        status = process.wait()
        out.seek(0)
        err.seek(0)
        return subprocess.CompletedProcess(words, status, out.read(), err.read())


def luigi(*words: str) -> None:
    """In the process that was forked: becomes the command."""
    os.chdir(ROOT)
    sys.path.insert(0, str(ROOT))
    sys.argv[1:] = words
    signal.alarm(_LONGEST_S)
    runpy.run_module("luigi", run_name="__main__", alter_sys=True)
