"""Commands on the mini scene, run for their exit status and their output."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


CELL = ["--scene", "mini", "--style", "p"]


def said(photographs: Path, *words: str) -> tuple[int, str]:
    """Exit status and screen of a command on the mini scene, where no GPU can be seen."""
    done = subprocess.run(
        [sys.executable, "-m", "luigi", "--module", "tasks", *words, "--content", "embedded"],
        cwd=ROOT,
        env={**os.environ, "STYLETRF_DATA": str(photographs), "CUDA_VISIBLE_DEVICES": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr
