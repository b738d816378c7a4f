"""The Luigi task whose artifact is in the store: its identity, and the methods of Luigi."""

import contextlib
import hashlib
from abc import abstractmethod
from collections.abc import Generator, Mapping
from pathlib import Path
from typing import Any, ClassVar

import luigi

from pipeline.artifacts import Artifacts
from pipeline.canonical import Json, canonical
from pipeline.errors import LostInputError, NotBuiltError, TaskFailure, describe_error
from pipeline.job import Display, RunContext, append_trace, write_outcome
from pipeline.record import Action, ActionRecord, public_version
from pipeline.settings import current_store, setting
from pipeline.store import Store


class ArtifactTask(luigi.Task):
    """A task that makes one artifact, a directory in the store that its key finds again.

    A subclass declares Luigi parameters, `requires()` returning such tasks by name, and `build`.
    Its key covers its family, `identity_parameters`, the digests of its inputs, the code that
    `build` depends on, and `tools`; see `docs/store.md`. `pipeline.task.StoredTask` adds how
    builds run, and on which machines.

    Attributes:
        tools: Distributions whose versions belong to the key.
        user_errors: Exceptions of `build` whose text is meant for the user.
        transient_errors: Exceptions of `build` that may pass. The build is then tried twice more.
        revision: A word that stands for the code in the key, instead of the code itself.
    """

    tools: ClassVar[tuple[str, ...]] = ()
    user_errors: ClassVar[tuple[type[Exception], ...]] = ()
    transient_errors: ClassVar[tuple[type[Exception], ...]] = (ConnectionError, TimeoutError)
    revision: ClassVar[str | None] = None

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)  # type: ignore[no-untyped-call]
        self._records: dict[Path, ActionRecord] = {}  # by store; absent ones are not cached
        self._sources: Mapping[str, str] | None = None
        self._lineage: tuple[str, ...] | None = None

    # What a subclass defines.

    def requires(self) -> Mapping[str, "ArtifactTask"]:
        """Returns the tasks whose artifacts `build` reads, by their names in `inputs`."""
        return {}

    @abstractmethod
    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Makes the artifact in the empty directory `out` from the artifacts in `inputs`.

        It runs in a process of its own. Only `inputs`, the parameters and the files that
        `external_digests` covers may decide the bytes.
        """

    def display_of_build(self, display: Display) -> Display:
        """Returns what `build` reports to; it may do more than show. It belongs to no key."""
        return display

    @abstractmethod
    def make(self, action: Action, store: Store) -> ActionRecord:
        """Returns the record of the artifact, which an executor finds or builds."""

    @property
    def artifacts(self) -> Artifacts:
        """Returns the store or stores that are searched for records and objects."""
        return Artifacts(current_store())

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns the parameters that decide the artifact's content: all significant ones."""
        names = self.get_param_names()  # type: ignore[no-untyped-call]
        return {name: self.param_kwargs[name] for name in names}

    def code(self, *, refresh: bool = False) -> str:  # noqa: ARG002  for subclasses
        """Returns the entry of the key for the code of `build`; here the pinned revision.

        Args:
            refresh: Whether to read the code again, although it is in memory.
        """
        return f"revision {self.revision}"

    def provenance(self, store: Store) -> Mapping[str, Json]:  # noqa: ARG002
        """Returns further entries of the record of a build, which decide nothing."""
        return {}

    def external_digests(self) -> Mapping[str, str]:
        """Returns digests of files that `build` reads outside the store; may raise user errors."""
        return {}

    def published(self) -> bool:
        """Returns whether everything that `publish` makes outside the store is in place."""
        return True

    def publish(self, object_path: Path) -> None:
        """Makes the artifact visible outside the store, such as by links; quick and repeatable."""

    @property
    def label(self) -> str:
        """Returns the task's name on the console: its family and the parameters that are words."""
        values = ArtifactTask.identity_parameters(self).values()
        words = [value for value in values if isinstance(value, str) and value]
        return " ".join([self.task_family, *words])

    # What Luigi calls.

    def complete(self) -> bool:
        """Returns whether the artifact of the present code and inputs exists; never raises."""
        try:
            return self.record() is not None and self.published()
        except Exception:  # noqa: BLE001  run() meets it again and reports it
            return False

    def output(self) -> "StoreTarget":
        """Returns the place of the artifact, whether it is built or not."""
        return StoreTarget(self)

    def run(self) -> "Generator[ArtifactTask, None, None] | None":
        """Finds the artifact under its resolved key (early cutoff) or makes it, and publishes it.

        Returns:
            None if it is done. If an input was lost, a generator that has Luigi make the input
            again first.

        Raises:
            TaskFailure: The build failed. The error has one line for the user.
        """
        store = current_store()
        try:
            self._require_recorded_inputs()
            record = self._records[store.root] = self.make(self.action(), store)
            if not self.published():
                self.publish(store.object(record.output.digest))
        except LostInputError as lost:
            return self._run_after(lost.args[0])
        except TaskFailure:
            raise
        except Exception as error:
            raise self._failure(error, store) from error
        return None

    def _require_recorded_inputs(self) -> None:
        """Refuses an upstream task that was never built here, although luigid may call it done."""
        for upstream in self.requires().values():
            try:
                upstream._recorded()
            except NotBuiltError as error:
                raise LostInputError(upstream) from error

    def _run_after(self, upstream: "ArtifactTask") -> "Generator[ArtifactTask, None, None]":
        self.forget()
        yield upstream
        if self.run():
            reason = f"its input {upstream} was lost twice. Run the same command again."
            raise TaskFailure("changed", str(self), reason)

    def _failure(self, error: Exception, store: Store) -> TaskFailure:
        """Returns the failure for an error outside the build, and logs its trace if it can."""
        log = store.root / "logs"
        with contextlib.suppress(OSError):
            append_trace(log := store.new_log(self.task_family, self._log_name()))
        kind, message = describe_error(error, log, self.user_errors, self.transient_errors)
        write_outcome(log, kind, message)
        return TaskFailure(kind, str(self), message)

    def _log_name(self) -> str:
        """Returns the key, or a digest of the task's name if the key cannot be computed."""
        try:
            return self.action().key
        except Exception:  # noqa: BLE001  the caller reports it
            return hashlib.sha256(self.task_id.encode()).hexdigest()

    # Identity.

    def action(self, *, refresh: bool = False) -> Action:
        """Returns everything that decides this artifact, with the digests of upstream artifacts.

        Args:
            refresh: Whether to read the code and outside files again, although known already.

        Raises:
            NotBuiltError: An upstream artifact was never built.
        """
        inputs = {n: task._recorded().output.digest for n, task in self.requires().items()}
        return self.action_with(inputs, refresh=refresh)

    def action_with(self, inputs: Mapping[str, str], *, refresh: bool = False) -> Action:
        """Returns the `action` with the given digests of inputs."""
        sources = self._sources  # another thread may forget it
        if refresh or sources is None:
            sources = self._sources = dict(self.external_digests())
        return Action(
            family=self.task_family,
            code=self.code(refresh=refresh),
            parameters=canonical(self.identity_parameters()),
            inputs=inputs,
            sources=sources,
            tools={name: public_version(name) for name in self.tools},
            salt=setting("store", "salt"),
        )

    def record(self) -> ActionRecord | None:
        """Returns the record if the artifact is available; raises what keeps the key unknown."""
        try:
            record = self._recorded()
        except NotBuiltError:
            return None
        return record if self.artifacts.is_available(record) else None

    def _recorded(self) -> ActionRecord:
        """Returns the record of the artifact, also after the object was collected."""
        store = current_store()
        record = self._records.get(store.root) or self.artifacts.lookup(self.action().key)
        if record is None:
            raise NotBuiltError(f"{self} is not built")
        self._records[store.root] = record
        return record

    def lineage(self) -> tuple[str, ...]:
        """Returns the keys of the upstream records, each once and after those that it needs.

        Raises:
            NotBuiltError: An upstream artifact was never built.
        """
        if self._lineage is None:
            keys: dict[str, None] = {}
            for upstream in self.requires().values():
                keys |= dict.fromkeys([*upstream.lineage(), upstream._recorded().action.key])
            self._lineage = tuple(keys)
        return self._lineage

    def forget(self, *, sources: bool = False) -> None:
        """Forgets the records, so that the store is read again.

        Args:
            sources: Whether to forget the digests of outside files as well.
        """
        self._records.clear()
        self._lineage = None
        if sources:
            self._sources = None


class StoreTarget(luigi.Target):
    """The place of a task's artifact, which is unknown until the task's inputs are known."""

    def __init__(self, task: ArtifactTask) -> None:
        self.task = task

    def exists(self) -> bool:
        """Returns whether the artifact is available; never raises."""
        return self.task.complete()

    @property
    def path(self) -> Path:
        """Returns the artifact's read-only directory, which `artifact` may have to fetch first.

        Raises:
            NotBuiltError: The artifact is not built.
        """
        record = self.task.record()
        if record is None:
            raise NotBuiltError(f"{self.task} is not built")
        return current_store().object(record.output.digest)

    def __str__(self) -> str:
        try:
            return str(self.path)
        except Exception:  # noqa: BLE001  Luigi prints targets in its own error messages
            return f"{self.task} (not built)"


def artifact(task: ArtifactTask) -> Path:
    """Returns the read-only directory of a finished task's artifact, and fetches it if needed.

    Raises:
        NotBuiltError: The artifact is not built, or the shared store does not return it.
    """
    path, record = StoreTarget(task).path, task.record()
    if not (record and task.artifacts.fetch(record)):
        raise NotBuiltError(f"{task} cannot be fetched. Run the same command again.")
    return path
