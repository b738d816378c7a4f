"""The executor of this machine: it leases GPUs, cores and memory, and runs the build there."""

import contextlib
import socket
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from pipeline.artifact_task import ArtifactTask
from pipeline.canonical import Json
from pipeline.console.display import build_display
from pipeline.execution.cost_history import DEFAULT_SECONDS, Cost, CostSample, record_cost
from pipeline.execution.cpu_memory import CpuAllocation
from pipeline.execution.deadline import require_time_left
from pipeline.execution.executors import EXECUTORS
from pipeline.execution.gpu import VISIBLE, Lease
from pipeline.execution.options import BuildOptions
from pipeline.execution.resources import cpu_for, expected_cost, lease_gpu, significant
from pipeline.job import Display, Job, Report
from pipeline.record import Action, ActionRecord
from pipeline.shared_store.checkpoints import forget_checkpoints, shared_checkpoints
from pipeline.store import Store


@dataclass(frozen=True)
class LocalExecutor:
    """Implements `pipeline.build.Executor`.

    Attributes:
        store: Where the costs of earlier builds are, and logs.
        options: Of the build.
    """

    store: Store
    options: BuildOptions

    @contextlib.contextmanager
    def reserve(self, task: ArtifactTask, action: Action) -> Iterator["LocalReservation"]:
        """Waits for GPUs, cores and memory, and holds them.

        Raises:
            TaskFailure: The deadline would pass before the build ended.
            StoreError: The folder of leases cannot be used.
        """
        options, cost = self.options, expected_cost(task, self.store)
        expected_s = cost.seconds if cost else DEFAULT_SECONDS
        with (
            lease_gpu(task.label, options.max_gpus) as gpus,
            cpu_for(task.label, cost) as cpu,
            build_display(task, task.label, expected_s) as display,
        ):
            require_time_left(task, options.until, action.key, cost, self.store)
            yield LocalReservation(action.key, options, gpus, cpu, display)

    def built(self, task: ArtifactTask, record: ActionRecord, report: Report) -> None:
        """Records the cost for later plans, and removes shared checkpoints."""
        is_whole = not report.earlier_seconds  # whose CPU time is not known
        cost = Cost(
            report.earlier_seconds + report.seconds,
            report.peak_memory_bytes,
            report.cpu_seconds if is_whole else None,
            record.output.size,
        )
        sample = CostSample(significant(task), cost, socket.gethostname())
        record_cost(self.store, task.task_family, sample)
        forget_checkpoints(record.action.key)


@dataclass(frozen=True)
class LocalReservation:
    """Implements `pipeline.build.Reservation`: GPUs, cores and memory of this host."""

    key: str
    options: BuildOptions
    gpus: Lease
    cpu: CpuAllocation
    display: Display

    @property
    def provenance(self) -> Mapping[str, Json]:
        """The GPUs and the number of cores."""
        return {"gpu": self.gpus[0].get(VISIBLE, ""), "cores": self.cpu.cores}

    def run(self, job: Job) -> Report:
        """Builds with what is held; checkpoints are shared meanwhile."""
        environment, gpu_files = self.gpus
        job = replace(
            job,
            timeout_seconds=self.options.timeout_seconds,
            memory_limit_bytes=self.options.memory_limit_bytes,
            environment={**dict(self.cpu.environment), **environment},
            inherited_fds=(*gpu_files, *self.cpu.inherited_fds),
            cpu_affinity=self.cpu.cpu_affinity,
        )
        with shared_checkpoints(self.key, Path(job.resume)) as fail:
            report = EXECUTORS[self.options.executor].run(job, self.display)
            if report.kind != "built":
                fail()
        return report
