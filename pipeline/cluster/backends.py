"""The clusters that run remote jobs: Ray and SLURM.

A backend takes a job, runs it on some node, and returns its result, after as many retries as the
cluster needs. It decides where a build runs. The store decides what is built and whether it is
valid, so the backend needs no shared folder.
"""

import base64
import contextlib
import os
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias

from pipeline.cluster.remote_job import JobResult, RemoteJob, runner_command
from pipeline.errors import StoreError
from pipeline.settings import invalid_setting, setting

_SECONDS_BETWEEN_POLLS = 2.0
_MAX_SECONDS_BETWEEN_POLLS = 20.0

Backend: TypeAlias = Callable[[RemoteJob], JobResult]
"""Runs a job on a node and returns its result; raises StoreError if the cluster cannot be used."""


def run_on_ray(job: RemoteJob) -> JobResult:
    """Runs a job on the Ray cluster at `[ray] address`, by default the one on this machine.

    The node has the cores, the memory and the GPUs. If it is lost, Ray runs the job again, up to
    three times.
    """
    address = setting("ray", "address")
    driver = [sys.executable, "-P", "-m", "pipeline.cluster.ray_driver", address]
    process = _run(driver, job, job.to_json())
    if process.returncode == os.EX_UNAVAILABLE:
        raise StoreError(f"Ray cannot be used: {_last_line(process.stderr)}")
    return JobResult.from_output(process.stdout or process.stderr)


_BATCH_SCRIPT = """#!/bin/sh
export {environment}
output=$({runner} 2>&1 <<'END_OF_JOB' | tail -n 1 | tail -c 16000 | base64 | tr -d '\\n'
{job}
END_OF_JOB
)
for seconds in 1 10 30; do
    scontrol update JobId="$SLURM_JOB_ID" Comment="$output" && exit
    sleep "$seconds"
done
"""


def run_on_slurm(job: RemoteJob) -> JobResult:
    """Runs a job on a SLURM cluster, which queues it again if its node fails.

    `[slurm] options` are added to the arguments of `sbatch`. The batch script contains the job, and
    the comment of the SLURM job returns the result.
    """
    environment = shlex.join(f"{name}={value}" for name, value in job.environment.items())
    runner = shlex.join(runner_command(Path("/dev/stdin")))
    script = _BATCH_SCRIPT.format(environment=environment, runner=runner, job=job.to_json())
    submitted = _run(["sbatch", "--parsable", *_sbatch_options(job)], job, script)
    job_id = submitted.stdout.partition(";")[0].strip()
    if not job_id:
        raise StoreError(f"SLURM cannot be used: {_last_line(submitted.stderr)}")
    started_s = time.monotonic()
    while state := _pending_state(job_id, job):
        if "held" in state.lower():
            _run(["scancel", job_id], job)
            return JobResult("killed", f"SLURM holds its job {job_id} back: {state}")
        waited_s = time.monotonic() - started_s  # longer jobs are polled less often
        pause_s = max(_SECONDS_BETWEEN_POLLS, waited_s / 20)
        time.sleep(min(_MAX_SECONDS_BETWEEN_POLLS, pause_s))
    return _slurm_result(job_id, job)


def _sbatch_options(job: RemoteJob) -> list[str]:
    """Returns the options of `sbatch`. Nodes are excluded only if the job can then run."""
    options = [
        "--requeue",
        f"--job-name=styletrf-{job.key[:16]}",
        "--dependency=singleton",  # a job that an earlier command left behind runs first
        f"--cpus-per-task={job.cores}",
        "--output=/dev/null",
        f"--chdir={job.folder}",
    ]
    if job.memory_bytes:
        options.append(f"--mem={-(-job.memory_bytes // 2**20)}M")
    if job.gpus and "gpu" in _run(["sinfo", "-h", "-o", "%G"], job).stdout:
        options.append(f"--gres=gpu:{job.gpus}")
    options += _options_of_user()
    if job.excluded_nodes:
        excluding = [*options, f"--exclude={','.join(job.excluded_nodes)}"]
        if _run(["sbatch", "--test-only", *excluding, "--wrap=true"], job).returncode == 0:
            return excluding
    return options


def _options_of_user() -> list[str]:
    """Returns `[slurm] options`, quoted as in a shell; a StoreError says that they are not."""
    try:
        return shlex.split(setting("slurm", "options"))
    except ValueError:  # a quote is not closed
        raise invalid_setting("slurm", "options", "a line of options as in a shell") from None


def _pending_state(job_id: str, job: RemoteJob) -> str:
    """Returns the state of a SLURM job that waits or runs; "" when it has ended.

    If the controller does not answer, the job counts as pending. (`sbatch --wait` would poll only
    every 30 seconds.)
    """
    answer = _run(["squeue", "--noheader", f"--jobs={job_id}", "--format=%T %r"], job)
    is_away = answer.returncode and "Invalid job" not in answer.stderr
    unknown = (answer.stderr.strip() or "no answer") if is_away else ""
    return answer.stdout.strip() or unknown


def _slurm_result(job_id: str, job: RemoteJob) -> JobResult:
    """Returns the result in the comment of a SLURM job that has ended."""
    query = ["squeue", "--noheader", "--states=all", f"--jobs={job_id}", "--format=%T %k"]
    state, _, comment = _run(query, job).stdout.strip().partition(" ")
    with contextlib.suppress(ValueError):
        if output := base64.b64decode(comment, validate=True).decode(errors="replace"):
            return JobResult.from_output(output)
    return JobResult.from_output(f"SLURM reports its job {job_id} as {state or 'unknown'}")


BACKENDS: Mapping[str, Backend] = {"ray": run_on_ray, "slurm": run_on_slurm}
"""The backends, by the value of `--executor`."""


def _run(command: list[str], job: RemoteJob, stdin: str = "") -> "subprocess.CompletedProcess[str]":
    """Runs a command of the cluster with the job's environment.

    Raises:
        StoreError: The command is not installed.
    """
    environment = {**os.environ, **job.environment}
    try:
        return subprocess.run(
            command, input=stdin, capture_output=True, text=True, check=False, env=environment
        )
    except FileNotFoundError as error:
        raise StoreError(
            f"{command[0]} is not installed on this machine: install it, or use another --executor"
        ) from error


def _last_line(text: str) -> str:
    return text.strip().rpartition("\n")[2] or "it ended without an error message"
