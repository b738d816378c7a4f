"""The task that stages derive from: an `ArtifactTask` with all that runs and shares its builds.

Here the parts of the pipeline are put together: the core knows none of the packages imported here.
"""

import functools
import multiprocessing
import signal
import warnings
from collections.abc import Generator, Mapping
from typing import cast

from luigi.parameter import UnconsumedParameterWarning

from pipeline.artifact_task import ArtifactTask, StoreTarget, artifact
from pipeline.build import build_once, find_or_build
from pipeline.canonical import Json
from pipeline.cluster.luigid import publish_key, require_same_key, stop_requesting_work
from pipeline.cluster.submission import build_on_cluster, is_cluster
from pipeline.code.closure import code_closure, save_closure
from pipeline.code.snapshot import code_in_key
from pipeline.errors import TaskFailure
from pipeline.execution.deadline import Deadline
from pipeline.execution.local_executor import LocalExecutor
from pipeline.execution.options import BuildOptions
from pipeline.execution.parent_process import die_with
from pipeline.job import RunContext
from pipeline.parameters import ChoiceParameter, FloatParameter
from pipeline.record import Action, ActionRecord
from pipeline.settings import current_store, setting
from pipeline.shared_store.sync import SharedArtifacts
from pipeline.store import Store

__all__ = ["RunContext", "StoreTarget", "StoredTask", "artifact"]

warnings.filterwarnings("ignore", ".*'rpc_retry_", UnconsumedParameterWarning)  # they are consumed


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
        description="begins nothing that would be running at this time, such as 06:00",
    )

    def requires(self) -> Mapping[str, "StoredTask"]:
        """The stored tasks whose artifacts `build` reads, by the name it reads them under."""
        return {}

    @property
    def needs_gpu(self) -> bool:
        """Whether `build` computes on a GPU where there is one; where not, it shall see none."""
        return False

    @property
    def max_gpus(self) -> int:
        """How many GPUs `build` uses at most, where so many are free."""
        return 1

    @property
    def options(self) -> BuildOptions:
        """How and where this task is built."""
        memory_gib = self.memory_gib or float(setting("store", "memory_gib"))
        return BuildOptions(
            executor=self.executor or setting("store", "executor"),
            until=self.until,
            timeout_seconds=self.timeout_seconds,
            memory_limit_bytes=int(memory_gib * 2**30),
            max_gpus=self.max_gpus if self.needs_gpu else 0,
        )

    @property
    def artifacts(self) -> SharedArtifacts:
        """The store of this machine, and the shared one behind it."""
        return SharedArtifacts(current_store())

    def code(self, *, refresh: bool = False) -> str:
        """The digest of all code that `build` reaches, or the revision that it pins."""
        code_of = code_in_key if refresh else _first_code
        return code_of(type(self), self.task_family, self.revision)

    def provenance(self, store: Store) -> Mapping[str, Json]:
        """The code that the build reached."""
        return {"closure": "" if self.revision else save_closure(code_closure(type(self)), store)}

    def is_usual(self, name: str) -> bool:
        """Whether a parameter has its default, or what the configuration file says instead."""
        family = self.task_family
        parameter = dict(self.get_params())[name]  # type: ignore[no-untyped-call]
        has_usual = parameter.has_task_value(family, name)
        return bool(has_usual and parameter.task_value(family, name) == self.param_kwargs[name])

    def show(self) -> bool:
        """Publish what is there but not shown, such as what another machine made; builds nothing.

        Returns:
            Whether it is there.

        Raises:
            NotBuiltError: When the shared store does not give it.
        """
        if not self.record():
            return False
        if not self.published():
            self.publish(artifact(self))
        return True

    def make(self, action: Action, store: Store) -> ActionRecord:
        """The record of the artifact: known, built here, or built on a node of a cluster."""
        publish_key(self, action.key)
        options = self.options

        def build() -> ActionRecord:
            if is_cluster(options.executor):
                return build_on_cluster(self, action, store, options)
            return build_once(self, action, store, LocalExecutor(store, options))

        return find_or_build(self, action, build)

    def run(self) -> "Generator[StoredTask, None, None] | None":
        """Find or build the artifact, and publish it; a worker ends with its command.

        Raises:
            TaskFailure: With one line for the user.
        """
        if command := multiprocessing.parent_process():  # which ends us, and says so, on Ctrl-C
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            die_with(int(command.pid or 0))
        try:
            return cast("Generator[StoredTask, None, None] | None", super().run())
        except TaskFailure as failure:
            stop_requesting_work(failure)
            raise

    def _run_after(self, upstream: ArtifactTask) -> "Generator[ArtifactTask, None, None]":
        self.forget()
        require_same_key(upstream, upstream.action().key)
        yield from super()._run_after(upstream)


_first_code = functools.cache(code_in_key)
"""The code as this process met it: what it imported stays the same, whatever an editor does."""
