"""Commands of this package, run for their exit status and their output."""

import os
import subprocess
from pathlib import Path

from forked_modules import ForkedModule

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
    """Runs `python -m luigi` with these words and further variables, forked."""
    process = forked("luigi", *words, **environment)
    try:
        screen = process.communicate(timeout=_LONGEST_S)
    except subprocess.TimeoutExpired:
        process.kill()
        raise
    return subprocess.CompletedProcess(words, process.returncode, *screen)


def forked(*words: str, stderr: int | None = subprocess.PIPE, **environment: str) -> ForkedModule:
    """`python -m` with these words and further variables, in the root of the repository."""
    variables = os.environ | environment
    return ForkedModule(current_fork_server(), words, cwd=ROOT, env=variables, stderr=stderr)
