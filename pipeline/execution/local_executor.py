"""The executor of this machine: it leases GPUs, cores and memory, and runs the build there."""

import logging
import socket
from dataclasses import dataclass, replace
from pathlib import Path

from pipeline.artifact_task import ArtifactTask
from pipeline.console.display import build_display
from pipeline.execution.cost_history import DEFAULT_SECONDS, Cost, CostSample, record_cost
from pipeline.execution.deadline import require_time_left
from pipeline.execution.executors import EXECUTORS
from pipeline.execution.gpu import VISIBLE
from pipeline.execution.options import BuildOptions
from pipeline.execution.resources import cpu_for, expected_cost, lease_gpu, significant
from pipeline.job import Job, Report
from pipeline.record import ActionRecord
from pipeline.shared_store.checkpoints import forget_checkpoints, shared_checkpoints
from pipeline.store import Store

_log = logging.getLogger("pipeline")


@dataclass(frozen=True)
class LocalExecutor:
    """Implements `pipeline.build.Executor`.

    Attributes:
        store: The store with the costs of earlier builds.
        options: The options of the build.
    """

    store: Store
    options: BuildOptions

    def run(self, task: ArtifactTask, job: Job) -> Report:
        """Waits for GPUs, cores and memory, and builds. It shares checkpoints while it builds.

        Raises:
            TaskFailure: The deadline would pass before the build ended.
            StoreError: The folder of leases cannot be used.
        """
        options, cost = self.options, expected_cost(task, self.store)
        expected_s = cost.seconds if cost else DEFAULT_SECONDS
        with (
            lease_gpu(task.label, options.max_gpus) as (gpu, gpu_files),
            cpu_for(task.label, cost) as cpu,
            build_display(task, task.label, expected_s) as display,
        ):
            require_time_left(task, options.until, cost)
            _log.info("%s: started", task.label)
            job = replace(
                job,
                timeout_seconds=options.timeout_seconds,
                memory_limit_bytes=options.memory_limit_bytes,
                environment={**dict(cpu.environment), **gpu},
                inherited_fds=(*gpu_files, *cpu.inherited_fds),
                cpu_affinity=cpu.cpu_affinity,
            )
            with shared_checkpoints(job.key, Path(job.resume)) as fail:
                report = EXECUTORS[options.executor](job, display)
                if report.kind != "built":
                    fail()
        return replace(report, gpu=gpu.get(VISIBLE, ""), cores=cpu.cores)

    def built(self, task: ArtifactTask, record: ActionRecord, report: Report) -> None:
        """Records the cost for later plans, and removes shared checkpoints."""
        is_whole = not report.earlier_seconds  # the CPU time of ended attempts is not known
        cost = Cost(
            report.earlier_seconds + report.seconds,
            report.peak_memory_bytes,
            report.cpu_seconds if is_whole else None,
            record.output.size,
        )
        sample = CostSample(significant(task), cost, socket.gethostname())
        record_cost(self.store, task.task_family, sample)
        forget_checkpoints(record.action.key)
