"""Engines that place builds on other machines: Ray and SLURM.

An engine is asked with an errand, and answers with the outcome, however often it had to send the
errand out. Machines need to share no folder for that. Where things are placed is its business; what
they are, and that they are right, the store's.
"""

import base64
import contextlib
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
_MOST_SECONDS_BETWEEN_LOOKS = 20.0


class Engine(Protocol):
    """Who finds a machine for an errand."""

    def run(self, errand: Errand) -> Outcome:
        """Have it built.

        Raises:
            StoreError: The engine itself cannot be used.
        """


class Ray:
    """A Ray cluster: `[ray] address`, by default the one that runs on this machine.

    Ray sends an errand again, three times, when its machine is lost.
    """

    def run(self, errand: Errand) -> Outcome:
        """Have it built on a node that has the cores, the memory and the card."""
        asked = [sys.executable, "-P", "-m", "pipeline.ray_engine", setting("ray", "address")]
        done = _run(asked, errand, errand.to_json())
        if done.returncode == NO_ENGINE:
            raise StoreError(f"Ray cannot be used: {_last_line(done.stderr)}")
        return outcome_in(done.stdout or done.stderr)


_JOB = """#!/bin/sh
export {environment}
said=$({build} 2>&1 <<'ERRAND' | tail -n 1 | tail -c 16000 | base64 | tr -d '\\n'
{errand}
ERRAND
)
for second in 1 10 30; do
    scontrol update JobId="$SLURM_JOB_ID" Comment="$said" && exit
    sleep "$second"
done
"""


class Slurm:
    """A SLURM cluster, by `sbatch`; `[slurm] options` are added to its words.

    The errand goes along in the job's script, and the outcome comes back in the job's comment.
    """

    def run(self, errand: Errand) -> Outcome:
        """Have it built by a job, which SLURM queues again when its node fails."""
        environment = shlex.join(f"{name}={word}" for name, word in errand.environment.items())
        build = shlex.join(command(Path("/dev/stdin")))
        script = _JOB.format(environment=environment, build=build, errand=errand.to_json())
        sent = _run(["sbatch", "--parsable", *self._words(errand)], errand, script)
        job = sent.stdout.partition(";")[0].strip()
        if not job:
            raise StoreError(f"SLURM cannot be used: {_last_line(sent.stderr)}")
        begun = time.monotonic()
        while told := self._waits_for(job, errand):
            if "held" in told.lower():
                _run(["scancel", job], errand)
                return Outcome("killed", f"SLURM does not let its job {job} begin: {told}")
            waited = time.monotonic() - begun  # a controller has more to do than to answer
            time.sleep(min(_MOST_SECONDS_BETWEEN_LOOKS, max(_SECONDS_BETWEEN_LOOKS, waited / 20)))
        return self._outcome(job, errand)

    def _waits_for(self, job: str, errand: Errand) -> str:
        """What SLURM says of a job that waits or runs; nothing once it is over.

        A controller that does not answer is waited for. (`sbatch --wait` looks every half minute.)
        """
        told = _run(["squeue", "--noheader", f"--jobs={job}", "--format=%T %r"], errand)
        is_away = told.returncode and "Invalid job" not in told.stderr
        return told.stdout.strip() or (told.stderr.strip() or "no answer" if is_away else "")

    def _outcome(self, job: str, errand: Errand) -> Outcome:
        """What a job that is over has left as its comment."""
        ask = ["squeue", "--noheader", "--states=all", f"--jobs={job}", "--format=%T %k"]
        state, _, comment = _run(ask, errand).stdout.strip().partition(" ")
        with contextlib.suppress(ValueError):
            if said := base64.b64decode(comment, validate=True).decode(errors="replace"):
                return outcome_in(said)
        return outcome_in(f"SLURM calls its job {job} {state or 'unknown'}")

    def _words(self, errand: Errand) -> list[str]:
        """For `sbatch`; without machines to leave out where it would then go to none."""
        words = [
            "--requeue",
            f"--job-name=styletrf-{errand.key[:16]}",
            "--dependency=singleton",  # one that another command left behind goes first
            f"--cpus-per-task={errand.cores}",
            "--output=/dev/null",
            f"--chdir={errand.folder}",
        ]
        if errand.memory_bytes:
            words.append(f"--mem={-(-errand.memory_bytes // 2**20)}M")
        if errand.gpus and "gpu" in _run(["sinfo", "-h", "-o", "%G"], errand).stdout:
            words.append(f"--gres=gpu:{errand.gpus}")
        words += setting("slurm", "options").split()
        if errand.rather_not:
            away = [*words, f"--exclude={','.join(errand.rather_not)}"]
            if _run(["sbatch", "--test-only", *away, "--wrap=true"], errand).returncode == 0:
                return away
        return words


ENGINES: Mapping[str, Engine] = {"ray": Ray(), "slurm": Slurm()}
"""By the word in `--executor`."""


def _run(words: list[str], errand: Errand, said: str = "") -> "subprocess.CompletedProcess[str]":
    """Run an engine's command, and say something to it; StoreError where it is not installed."""
    environment = {**os.environ, **errand.environment}
    try:
        return subprocess.run(
            words, input=said, capture_output=True, text=True, check=False, env=environment
        )
    except FileNotFoundError as error:
        raise StoreError(f"{words[0]} is not installed on this machine") from error


def _last_line(said: str) -> str:
    return said.strip().rpartition("\n")[2] or "it ended without a word"
