"""Engines that place builds on other machines: Ray and SLURM.

An engine is asked with an errand, which lies in a folder that this machine has, and answers with
the outcome, however often it had to send it out. Where things are placed is its business; what they
are, and that they are right, the store's.
"""

import os
import shlex
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

from pipeline.errand import NO_ENGINE, Errand, Outcome, command, outcome_in
from pipeline.errors import StoreError
from pipeline.settings import setting

_SECONDS_BETWEEN_LOOKS = 2.0


class Engine(Protocol):
    """Who finds a machine for an errand."""

    def run(self, errand: Errand, folder: Path) -> Outcome:
        """Have it built; `folder` takes the errand, and what is printed about it.

        Raises:
            StoreError: The engine itself cannot be used.
        """


class Ray:
    """A Ray cluster: `[ray] address`, by default the one that runs on this machine.

    Ray sends an errand again, three times, when its machine is lost.
    """

    def run(self, errand: Errand, folder: Path) -> Outcome:
        """Have it built on a node that has the cores, the memory and the card."""
        file = _written(errand, folder)
        asked = [sys.executable, "-P", "-m", "pipeline.ray_engine", str(file)]
        done = _run([*asked, setting("ray", "address")], errand)
        if done.returncode == NO_ENGINE:
            raise StoreError(f"Ray cannot be used: {_last_line(done.stderr)}")
        return outcome_in(done.stdout or done.stderr)


class Slurm:
    """A SLURM cluster, by `sbatch`; `[slurm] options` are added to its words."""

    def run(self, errand: Errand, folder: Path) -> Outcome:
        """Have it built by a job, which SLURM queues again when its node fails."""
        file = _written(errand, folder)
        said = file.with_suffix(".out")
        done = _run([*self._sbatch(errand, said), "--wrap", shlex.join(command(file))], errand)
        job = done.stdout.partition(";")[0].strip()
        if not job:
            raise StoreError(f"SLURM cannot be used: {_last_line(done.stderr)}")
        while self._is_queued(job, errand):
            time.sleep(_SECONDS_BETWEEN_LOOKS)
        return outcome_in(said.read_text() if said.exists() else "")

    def _is_queued(self, job: str, errand: Errand) -> bool:
        """Whether it waits or runs; `sbatch --wait` looks every half minute only.

        A controller that does not answer is waited for.
        """
        told = _run(["squeue", "--noheader", f"--jobs={job}", "--format=%T"], errand)
        return bool(told.stdout.strip() or (told.returncode and "Invalid job" not in told.stderr))

    def _sbatch(self, errand: Errand, said: Path) -> list[str]:
        words = [
            *("sbatch", "--parsable", "--requeue"),
            f"--job-name=styletrf-{errand.key[:16]}",
            f"--cpus-per-task={errand.cores}",
            f"--output={said}",
            f"--chdir={errand.folder}",
        ]
        if errand.memory_bytes:
            words.append(f"--mem={-(-errand.memory_bytes // 2**20)}M")
        if errand.rather_not and self._others(errand):
            words.append(f"--exclude={','.join(errand.rather_not)}")
        if errand.gpus and "gpu" in _run(["sinfo", "-h", "-o", "%G"], errand).stdout:
            words.append(f"--gres=gpu:{errand.gpus}")
        return words + setting("slurm", "options").split()

    def _others(self, errand: Errand) -> set[str]:
        """The nodes beside those to be left out."""
        names = _run(["sinfo", "--noheader", "--Node", "--format=%N"], errand).stdout.split()
        return {*names} - {*errand.rather_not}


ENGINES: Mapping[str, Engine] = {"ray": Ray(), "slurm": Slurm()}
"""By the word in `--executor`."""


def _written(errand: Errand, folder: Path) -> Path:
    file = folder / "errand.json"
    file.write_text(errand.to_json())
    return file


def _run(words: list[str], errand: Errand) -> "subprocess.CompletedProcess[str]":
    """Run an engine's command; StoreError where it is not installed."""
    environment = {**os.environ, **errand.environment}
    try:
        return subprocess.run(words, capture_output=True, text=True, check=False, env=environment)
    except FileNotFoundError as error:
        raise StoreError(f"{words[0]} is not installed on this machine") from error


def _last_line(said: str) -> str:
    return said.strip().rpartition("\n")[2] or "it ended without a word"
