"""`python -m pipeline.cluster.job_runner JOB.json`: runs a `RemoteJob` on a node of a cluster.

It is an ordinary build of that machine, which reads its inputs from the shared store and uploads
its artifact there. The last line on standard output is the `JobResult`.
"""

import importlib
import os
import socket
import sys
from pathlib import Path

from pipeline.artifact_task import ArtifactTask
from pipeline.cluster.remote_job import NODE, JobResult, RemoteJob
from pipeline.errors import (
    FailureKind,
    LostInputError,
    NotBuiltError,
    TaskFailure,
    is_disk_full,
)
from pipeline.execution.parent_process import die_with
from pipeline.settings import current_store


def run_remote_job(job: RemoteJob) -> JobResult:
    """Builds the job's task on this machine; the result reports every failure."""
    host = socket.gethostname()
    node = os.environ.get(NODE) or os.environ.get("SLURMD_NODENAME", "")
    try:
        store = current_store()
        task_class: type[ArtifactTask] = getattr(importlib.import_module(job.module), job.task)
        task: ArtifactTask = task_class.from_str_params(dict(job.parameters))  # type: ignore[no-untyped-call]
        action = task.action()
        if action.key != job.key:
            return JobResult("user", _other_key(host, action.key, job.key), host)
        record = task.make(action, store)
        task.artifacts.upload(record)  # an artifact found here may never have been uploaded
    except LostInputError as lost:
        return JobResult("lost", lost.args[0].task_id, host)
    except NotBuiltError as error:
        return JobResult("lost", str(error), host)
    except TaskFailure as failure:
        return JobResult(failure.kind, failure.reason, host, node)
    except Exception as error:  # noqa: BLE001  the machine that submitted the job reports it
        kind: FailureKind = "disk" if is_disk_full(error) else "crash"
        return JobResult(kind, f"{type(error).__name__}: {error}", host, node)
    return JobResult("built", host=host)


def _other_key(host: str, own: str, expected: str) -> str:
    return (
        f"{host} has other code, inputs or files than the machine that sent the job:"
        f" it would build {own[:16]}, not {expected[:16]}."
        " Give all machines the same commit, packages and data"
    )


def main() -> None:
    """Runs the job and prints its result."""
    die_with(os.getppid())
    result = run_remote_job(RemoteJob.from_json(Path(sys.argv[1]).read_text()))
    sys.stdout.write(f"\n{result.to_json()}\n")


if __name__ == "__main__":
    main()
