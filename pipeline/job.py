"""The interface of a build: its input, its reports, and the files that an attempt leaves."""

import contextlib
import json
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

from pipeline.errors import FailureKind, Outcome
from pipeline.record import ActionRecord


class Display(Protocol):
    """A place that shows the progress of one build."""

    def __call__(self, done: int, total: int, **quality: float) -> None:
        """Shows `done` of `total` units of work, and the quality reached, such as psnr or loss.

        Both numbers may restart for a further phase.
        """

    def say(self, line: str) -> None:
        """Shows a line that stays on the screen."""

    def close(self) -> None:
        """Removes the progress from the screen."""


@dataclass(frozen=True, slots=True)
class RunContext:
    """The folders, progress and options that a build may use in addition to its inputs.

    Attributes:
        progress: The build calls it about once a second.
        resume: A directory of this build for checkpoints, which survive if the build is killed.
        log: The file for standard output and standard error.
        lineage: The records of all upstream artifacts, each after those that it needs.
    """

    progress: Display
    resume: Path
    log: Path
    lineage: tuple[ActionRecord, ...] = ()


@dataclass(frozen=True, slots=True)
class Job:
    """One build, which another interpreter reads as JSON.

    Attributes:
        module: The module of the task's class.
        task: The name of the class.
        parameters: The task's parameters, serialized.
        label: The task on the screen.
        inputs: The directories of the artifacts to read, by name.
        out: The directory to fill. The executor may write files beside it.
        resume: The directory of checkpoints.
        log: The file for the lines that the build prints.
        lineage: The keys of the upstream records.
        timeout_seconds: The time after which the build is ended; 0 for no limit.
        memory_limit_bytes: The resident memory at which the build is ended; 0 for no limit.
        environment: Variables to set.
        inherited_fds: Descriptors that the build holds open; their flocks are leases.
        cpu_affinity: The cores to run on; empty for all.
        key: The key of the action.
    """

    module: str
    task: str
    parameters: dict[str, str]
    label: str
    inputs: dict[str, str]
    out: str
    resume: str
    log: str
    lineage: tuple[str, ...] = ()
    timeout_seconds: float = 0.0
    memory_limit_bytes: int = 0
    environment: Mapping[str, str] = field(default_factory=dict)
    inherited_fds: tuple[int, ...] = ()
    cpu_affinity: tuple[int, ...] = ()
    key: str = ""


@dataclass(frozen=True, slots=True)
class Report:
    """The outcome of a build.

    Attributes:
        kind: "built", or the kind of `TaskFailure` that it was.
        message: Why it failed.
        status: Its exit status, or minus the signal that ended it.
        seconds: Wall-clock time.
        peak_memory_bytes: The largest resident memory of all its processes together.
        earlier_seconds: The time of ended attempts whose checkpoints it used.
        cpu_seconds: The CPU time of the build.
        other_cpu_seconds: The CPU time of all other processes in the same time.
        gpu: The UUIDs of its GPUs.
        cores: The number of its cores.
    """

    kind: Literal["built"] | FailureKind
    message: str
    status: int
    seconds: float
    peak_memory_bytes: int
    earlier_seconds: float = 0.0
    cpu_seconds: float = 0.0
    other_cpu_seconds: float = 0.0
    gpu: str = ""
    cores: int = 0


def append_trace(log: Path) -> None:
    """Adds the exception being handled to a log, if the disk has room for it."""
    with contextlib.suppress(OSError), log.open("a") as file:
        traceback.print_exc(file=file)


def write_outcome(log: Path, kind: Outcome, reason: str) -> None:
    """Adds the reason to the log of an attempt, and writes kind and reason as JSON beside it.

    An attempt is "interrupted" until it has another outcome: a killed process writes nothing.
    On a full disk it removes that outcome, writes nothing, and raises no error.
    """
    with contextlib.suppress(OSError):
        (file := log.with_suffix(".json")).unlink(missing_ok=True)
        with log.open("a") as lines:
            lines.write(f"{reason}\n" if reason else "")
        file.write_text(json.dumps({"kind": kind, "reason": reason}))
