"""The task that stages derive from: an `ArtifactTask` that runs and shares its builds.

This module combines the parts of the pipeline. The core imports none of these packages.
"""

import contextlib
import functools
import multiprocessing
import signal
import warnings
from collections.abc import Generator, Mapping
from typing import cast

from luigi.parameter import UnconsumedParameterWarning

from pipeline.artifact_task import ArtifactTask, StoreTarget, artifact
from pipeline.build import build_once
from pipeline.canonical import Json
from pipeline.cluster.backends import BACKENDS
from pipeline.cluster.luigid import publish_key, require_same_key, stop_requesting_work
from pipeline.cluster.submission import build_on_cluster
from pipeline.code.closure import code_closure, save_closure
from pipeline.code.snapshot import code_in_key, present_code
from pipeline.errors import NotBuiltError, TaskFailure
from pipeline.execution.deadline import Deadline
from pipeline.execution.local_executor import LocalExecutor
from pipeline.execution.options import BuildOptions
from pipeline.execution.parent_process import die_with
from pipeline.job import RunContext
from pipeline.parameters import ChoiceParameter, FloatParameter
from pipeline.record import Action, ActionRecord
from pipeline.settings import current_store, number_setting, setting
from pipeline.shared_store.sync import SharedArtifacts
from pipeline.store import Store

__all__ = ["RunContext", "StoreTarget", "StoredTask", "artifact"]

warnings.filterwarnings("ignore", ".*'rpc_retry_", UnconsumedParameterWarning)  # Luigi reads them


class StoredTask(ArtifactTask):
    """An `ArtifactTask` that is built on this machine or on a cluster, and shared."""

    timeout_seconds = FloatParameter(
        default=0.0, significant=False, positional=False, description="ends longer builds"
    )
    memory_gib = FloatParameter(
        default=0.0, significant=False, positional=False, description="ends larger builds"
    )
    executor = ChoiceParameter(
        choices=["", "inline", "subprocess", "ray", "slurm"],
        default="",
        significant=False,
        positional=False,
        description="what runs builds: a process here (subprocess), or machines of a ray or slurm"
        " cluster; [store] executor where this is empty",
    )
    until = Deadline(
        default=None,
        significant=False,
        positional=False,
        description="starts no build that would be running at this time, such as 06:00",
    )

    def requires(self) -> Mapping[str, "StoredTask"]:
        """Returns the tasks whose artifacts `build` reads, by their names in `inputs`."""
        return {}

    @property
    def needs_gpu(self) -> bool:
        """Whether `build` computes on a GPU if there is one. If not, it sees no GPU."""
        return False

    @property
    def max_gpus(self) -> int:
        """Returns how many GPUs `build` uses at most, if enough are free."""
        return 1

    @property
    def options(self) -> BuildOptions:
        """Returns how and where this task is built."""
        memory_gib = self.memory_gib or number_setting("store", "memory_gib")
        return BuildOptions(
            executor=self.executor or setting("store", "executor"),
            until=self.until,
            timeout_seconds=self.timeout_seconds,
            memory_limit_bytes=int(memory_gib * 2**30),
            max_gpus=self.max_gpus if self.needs_gpu else 0,
        )

    @property
    def artifacts(self) -> SharedArtifacts:
        """Returns the store of this machine, with the shared store behind it."""
        return SharedArtifacts(current_store())

    def code(self, *, refresh: bool = False) -> str:
        """Returns the digest of all code that `build` reaches, or its pinned revision.

        An adoption of this code counts only if it was there when this process read the code first.
        """
        first, in_key = _first_code(type(self), self.task_family, self.revision)
        now = present_code(type(self), self.revision) if refresh else first
        return in_key if now == first else now

    def provenance(self, store: Store) -> Mapping[str, Json]:
        """Returns the digest of the list of code that the build reached."""
        return {"closure": "" if self.revision else save_closure(code_closure(type(self)), store)}

    def is_default(self, name: str) -> bool:
        """Whether a parameter has its default value, or the value in the configuration file."""
        family = self.task_family
        parameter = dict(self.get_params())[name]  # type: ignore[no-untyped-call]
        has_default = parameter.has_task_value(family, name)
        return bool(has_default and parameter.task_value(family, name) == self.param_kwargs[name])

    def show(self) -> bool:
        """Publishes an existing artifact outside the store, without a build.

        Another machine may have made the artifact.

        Returns:
            Whether the artifact exists.

        Raises:
            NotBuiltError: The shared store does not return the artifact.
        """
        if not self.record():
            return False
        if not self.published():
            self.publish(artifact(self))
        return True

    def make(self, action: Action, store: Store) -> ActionRecord:
        """Returns the record of the artifact: a known one, or that of a build here or on a node."""
        publish_key(self, action.key)
        known, options = self.artifacts, self.options
        record = known.find(action.key)
        if record and (self.published() or known.fetch(record)):
            return record
        if options.executor in BACKENDS:
            return build_on_cluster(self, action, store, options)
        return build_once(self, action, store, LocalExecutor(store, options))

    def run(self) -> "Generator[StoredTask, None, None] | None":
        """Finds or builds the artifact, and publishes it.

        A worker process ends with its command.

        Raises:
            TaskFailure: The build failed. The error has one line for the user.
        """
        if command := multiprocessing.parent_process():  # it ends this worker on Ctrl-C
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            die_with(int(command.pid or 0))
        try:
            return cast("Generator[StoredTask, None, None] | None", super().run())
        except TaskFailure as failure:
            stop_requesting_work(failure)
            raise

    def _run_after(self, upstream: ArtifactTask) -> "Generator[ArtifactTask, None, None]":
        self.forget()
        with contextlib.suppress(NotBuiltError):  # without its own inputs it has no key yet
            require_same_key(upstream, upstream.action().key)
        yield from super()._run_after(upstream)


@functools.cache
def _first_code(task: type, family: str, revision: str | None) -> tuple[str, str]:
    """Returns the code as this process read it first, and the text that represents it in the key.

    Imported code does not change with the files.
    """
    code = present_code(task, revision)
    return code, code_in_key(family, code)
