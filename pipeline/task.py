"""The Luigi task whose artifact lies in the store."""

import functools
import hashlib
import multiprocessing
import signal
import sys
import warnings
from abc import abstractmethod
from collections.abc import Generator, Mapping
from pathlib import Path
from typing import Any, ClassVar

import luigi
from luigi.parameter import UnconsumedParameterWarning

from pipeline.building import find_or_build
from pipeline.canonical import canonical
from pipeline.cluster.luigid import publish_key, require_same_key, stop_requesting_work
from pipeline.cluster.submission import builder_of
from pipeline.console.log_handler import report_exception
from pipeline.deadline import Deadline
from pipeline.errors import LostInputError, NotBuiltError, TaskFailure, explain
from pipeline.execution import RunContext, append_trace
from pipeline.parameters import ChoiceParameter, FloatParameter
from pipeline.parent_process import die_with
from pipeline.record import Action, ActionRecord, public_version
from pipeline.settings import current_store, require_configuration, setting
from pipeline.sharing import is_available, recorded
from pipeline.snapshot import code_in_key
from pipeline.store import Store
from pipeline.target import StoreTarget, artifact

__all__ = ["RunContext", "StoreTarget", "StoredTask", "artifact"]

sys.excepthook = report_exception  # Luigi looks for the task's name after importing its module
warnings.filterwarnings("ignore", ".*'rpc_retry_", UnconsumedParameterWarning)  # they are consumed


class StoredTask(luigi.Task):
    """A task that makes one artifact: a directory, found again by what it was made from.

    A subclass declares Luigi parameters, `requires()` returning stored tasks by name, and `build`.
    Its key covers its family, `identity_parameters`, the digests of its inputs, the code that
    `build` depends on, and `tools`; see `docs/store.md`.

    Attributes:
        tools: Distributions whose versions belong to the key.
        user_errors: Exceptions of `build` whose text is meant for the user.
        transient_errors: Exceptions of `build` that may pass: it is tried again, twice.
        revision: A word that stands for the code in the key, instead of the code itself.
    """

    tools: ClassVar[tuple[str, ...]] = ()
    user_errors: ClassVar[tuple[type[Exception], ...]] = ()
    transient_errors: ClassVar[tuple[type[Exception], ...]] = (ConnectionError, TimeoutError)
    revision: ClassVar[str | None] = None

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

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        require_configuration()
        super().__init__(*args, **kwargs)  # type: ignore[no-untyped-call]
        self._records: dict[Path, ActionRecord] = {}  # by store; positive facts only
        self._sources: Mapping[str, str] | None = None
        self._lineage: tuple[str, ...] | None = None

    # What a subclass defines.

    def requires(self) -> Mapping[str, "StoredTask"]:
        """The stored tasks whose artifacts `build` reads, by the name it reads them under."""
        return {}

    @abstractmethod
    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Make the artifact in the empty directory `out` from the artifacts in `inputs`.

        Runs in a fresh interpreter. All that decides the bytes comes through `inputs`, the
        parameters and the files that `external_digests` covers.
        """

    def identity_parameters(self) -> Mapping[str, object]:
        """The values that decide the artifact's content: all significant parameters."""
        names = self.get_param_names()  # type: ignore[no-untyped-call]
        return {name: self.param_kwargs[name] for name in names}

    def external_digests(self) -> Mapping[str, str]:
        """Digests of what `build` reads from outside the store; may raise a user's error."""
        return {}

    def published(self) -> bool:
        """Whether what `publish` makes outside the store is in place."""
        return True

    def publish(self, object_path: Path) -> None:
        """Make the artifact visible outside the store, such as by links; quick and repeatable."""

    def show(self) -> None:
        """Publish what is there but not shown, such as what another machine made; builds nothing.

        Raises:
            NotBuiltError: When the shared store does not give it.
        """
        if self.record() and not self.published():
            self.publish(artifact(self))

    @property
    def label(self) -> str:
        """The task on the screen: its family and those parameters that are words."""
        names = self.get_param_names()  # type: ignore[no-untyped-call]
        values = (self.param_kwargs[name] for name in names)
        words = [value for value in values if isinstance(value, str) and value]
        return " ".join([self.task_family, *words])

    def is_usual(self, name: str) -> bool:
        """Whether a parameter has its default, or what the configuration file says instead."""
        family = self.task_family
        parameter = dict(self.get_params())[name]  # type: ignore[no-untyped-call]
        has_usual = parameter.has_task_value(family, name)
        return bool(has_usual and parameter.task_value(family, name) == self.param_kwargs[name])

    @property
    def needs_gpu(self) -> bool:
        """Whether `build` computes on a GPU where there is one; where not, it shall see none."""
        return False

    @property
    def most_cards(self) -> int:
        """How many GPUs `build` uses at most, where so many are free."""
        return 1

    # What Luigi asks.

    def complete(self) -> bool:
        """Whether the artifact exists, for the present code and inputs; never raises."""
        try:
            return self.record() is not None and self.published()
        except Exception:  # noqa: BLE001  run() meets it again and reports it
            return False

    def output(self) -> StoreTarget:
        """The artifact, built or not."""
        return StoreTarget(self)

    def run(self) -> "Generator[StoredTask, None, None] | None":
        """Find the artifact under its resolved key (early cut-off) or build it; then publish it.

        Returns:
            None, done; or, where an input was lost, what has Luigi make that again first.

        Raises:
            TaskFailure: With one line for the user.
        """
        if command := multiprocessing.parent_process():  # which ends us, and says so, on Ctrl-C
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            die_with(int(command.pid or 0))
        store = current_store()
        try:
            if (missing := self._missing()) is not None:
                return self._run_after(missing)
            action = self.action()
            publish_key(self, action.key)
            record = self._records[store.root] = find_or_build(
                self, action, store, builder_of(self)
            )
            if not self.published():
                self.publish(store.object(record.output.digest))
        except LostInputError as lost:
            return self._run_after(lost.args[0])
        except TaskFailure as failure:
            stop_requesting_work(failure)
            raise
        except Exception as error:
            met = self._failure(error, store)
            stop_requesting_work(met)
            raise met from error
        return None

    def _missing(self) -> "StoredTask | None":
        """What is upstream and was never built here, although a scheduler may call it done."""
        for upstream in self.requires().values():
            try:
                upstream._recorded()
            except NotBuiltError:
                return upstream
        return None

    def _run_after(self, upstream: "StoredTask") -> "Generator[StoredTask, None, None]":
        self.forget()
        require_same_key(upstream, upstream.action().key)
        yield upstream
        if self.run():
            reason = f"its input {upstream} is lost again and again. Run the same command again."
            raise TaskFailure("changed", str(self), reason)

    # Identity.

    def action(self, *, refresh: bool = False) -> Action:
        """What decides this artifact, with everything upstream resolved to its content.

        Args:
            refresh: Read the code and the outside files again instead of trusting memory.

        Raises:
            NotBuiltError: When an upstream artifact was never built.
        """
        inputs = {n: task._recorded().output.digest for n, task in self.requires().items()}
        return self.action_with(inputs, refresh=refresh)

    def action_with(self, inputs: Mapping[str, str], *, refresh: bool = False) -> Action:
        """`action`, with these digests as those of the inputs."""
        if refresh or self._sources is None:
            self._sources = dict(self.external_digests())
        return Action(
            family=self.task_family,
            code=(code_in_key if refresh else _first_code)(type(self)),
            parameters=canonical(self.identity_parameters()),
            inputs=inputs,
            sources=self._sources,
            tools={name: public_version(name) for name in self.tools},
            salt=setting("store", "salt"),
        )

    def record(self) -> ActionRecord | None:
        """The record of the artifact, if that can be had; raises what keeps its key unknown."""
        try:
            record = self._recorded()
        except NotBuiltError:
            return None
        return record if is_available(current_store(), record) else None

    def _recorded(self) -> ActionRecord:
        """The record of the artifact, even if the object was collected: its digest suffices."""
        store = current_store()
        record = self._records.get(store.root) or recorded(store, self.action().key)
        if record is None:
            raise NotBuiltError(f"{self} is not built")
        self._records[store.root] = record
        return record

    def lineage(self) -> tuple[str, ...]:
        """The keys of the records upstream, each once, first things first.

        Raises:
            NotBuiltError: When an upstream artifact was never built.
        """
        if self._lineage is None:
            keys: dict[str, None] = {}
            for upstream in self.requires().values():
                keys |= dict.fromkeys([*upstream.lineage(), upstream._recorded().action.key])
            self._lineage = tuple(keys)
        return self._lineage

    def forget(self) -> None:
        """Ask the store again next time."""
        self._records.clear()
        self._lineage = None

    def _failure(self, error: Exception, store: Store) -> TaskFailure:
        """What went wrong around the build, its trace put into a log of its own."""
        append_trace(log := store.new_log(self.task_family, self._log_name()))
        kind, message = explain(error, log, self.user_errors, self.transient_errors)
        return TaskFailure(kind, str(self), message)

    def _log_name(self) -> str:
        """The key; where that is what failed, something that is this task's, too."""
        try:
            return self.action().key
        except Exception:  # noqa: BLE001  the caller reports it
            return hashlib.sha256(self.task_id.encode()).hexdigest()


_first_code = functools.cache(code_in_key)
"""The code as this process met it: what it imported stays the same, whatever an editor does."""
