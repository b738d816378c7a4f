"""`python -m pipeline.cluster.job_runner JOB.json`: runs a `RemoteJob` on a node of a cluster.

It is an ordinary build of that machine, which reads its inputs from the shared store and uploads
its artifact there. The last line on standard output is the `JobResult`.
"""

import importlib
import os
import socket
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.building import find_or_build
from pipeline.cluster.remote_job import NODE, JobResult, RemoteJob
from pipeline.errors import (
    FailureKind,
    LostInputError,
    NotBuiltError,
    TaskFailure,
    tells_of_full_disk,
)
from pipeline.parent_process import die_with
from pipeline.settings import current_store
from pipeline.sharing import give

if TYPE_CHECKING:
    from pipeline.task import StoredTask


def run_job(job: RemoteJob) -> JobResult:
    """Builds the job's task on this machine; every failure is in the result."""
    host = socket.gethostname()
    node = os.environ.get(NODE) or os.environ.get("SLURMD_NODENAME", "")
    try:
        store = current_store()
        task_class: type[StoredTask] = getattr(importlib.import_module(job.module), job.task)
        task: StoredTask = task_class.from_str_params(dict(job.parameters))  # type: ignore[no-untyped-call]
        action = task.action()
        if action.key != job.key:
            return JobResult("user", _other_key(host, action.key, job.key), host)
        record = find_or_build(task, action, store)
        give(store, record)  # an artifact found here may never have been uploaded
    except LostInputError as lost:
        return JobResult("lost", lost.args[0].task_id, host)
    except NotBuiltError as error:
        return JobResult("lost", str(error), host)
    except TaskFailure as failure:
        return JobResult(failure.kind, failure.reason, host, node)
    except Exception as error:  # noqa: BLE001  the machine that submitted the job reports it
        kind: FailureKind = "disk" if tells_of_full_disk(error) else "crash"
        return JobResult(kind, f"{type(error).__name__}: {error}", host, node)
    return JobResult("built", host=host)


def _other_key(host: str, own: str, expected: str) -> str:
    return (
        f"{host} has other code, inputs or files than the machine that asks:"
        f" it would build {own[:16]}, not {expected[:16]}."
        " Give all machines the same commit, packages and data"
    )


def main() -> None:
    """Runs the job and prints its result."""
    die_with(os.getppid())
    result = run_job(RemoteJob.from_json(Path(sys.argv[1]).read_text()))
    sys.stdout.write(f"\n{result.to_json()}\n")


if __name__ == "__main__":
    main()
