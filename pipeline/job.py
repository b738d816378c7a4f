"""What a build receives, how it reports, and what an attempt at it leaves beside its log."""

import contextlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

from pipeline.errors import FailureKind
from pipeline.record import ActionRecord


class Progress(Protocol):
    """A callback with the work done, the total and the quality reached (such as psnr or loss)."""

    def __call__(self, done: int, total: int, **quality: float) -> None:
        """Report `done` of `total` units of work; both may restart for a further phase."""


class Display(Progress, Protocol):
    """A place that shows the progress of one build."""

    def say(self, line: str) -> None:
        """Show a line that stays on the screen."""

    def close(self) -> None:
        """Remove the progress from the screen."""


@dataclass(frozen=True, slots=True)
class RunContext:
    """What a build may use besides its inputs.

    Attributes:
        progress: To be called every second or so.
        resume: A directory private to the build, for checkpoints; as a rule, it survives kills.
        log: The file that takes standard output and standard error.
        lineage: The records of all artifacts upstream, first things first.
    """

    progress: Display
    resume: Path
    log: Path
    lineage: tuple[ActionRecord, ...] = ()


@dataclass(frozen=True, slots=True)
class Job:
    """One build, as JSON for another interpreter.

    Attributes:
        module: The module of the task's class.
        task: The name of the class.
        parameters: The task's parameters, serialized.
        label: The task on the screen.
        inputs: The directories of the artifacts to read, by name.
        out: The directory to fill; the executor may write beside it.
        resume: The directory of checkpoints.
        log: The file for what the build prints.
        lineage: Keys of the records upstream.
        timeout_seconds: When to end the build, if not 0.
        memory_limit_bytes: The resident memory of its processes at which to end it, if not 0.
        environment: Variables to set.
        inherited_fds: Descriptors that the build holds open; their flocks are leases.
        cpu_affinity: The cores to run on; all if there is none.
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
    """How a build ended.

    Attributes:
        kind: "built", or the kind of `TaskFailure` that it was.
        message: Why it did not succeed.
        status: Its exit status, or minus the signal that ended it.
        seconds: Wall-clock time.
        peak_memory_bytes: Largest resident memory, of all processes of the build together.
        earlier_seconds: The time of attempts that were ended, and whose checkpoints it used.
        cpu_seconds: The CPU time of the build.
        other_cpu_seconds: The CPU time of everything else on the machine meanwhile.
        gpu: The GPUs it had, by their UUIDs.
        cores: How many cores it had.
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


def write_outcome(log: Path, kind: Literal["built"] | FailureKind, reason: str) -> None:
    """Ends the log of an attempt with the reason, and writes both as JSON beside it.

    On a full disk nothing is written, which is no reason to fail.
    """
    with contextlib.suppress(OSError):
        with log.open("a") as file:
            file.write(f"{reason}\n")
        log.with_suffix(".json").write_text(json.dumps({"kind": kind, "reason": reason}))


def read_outcome(log: Path) -> tuple[str, str]:
    """The kind and the reason that `write_outcome` wrote; else "" and the last line of the log."""
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        outcome = json.loads(log.with_suffix(".json").read_text())
        return str(outcome["kind"]), str(outcome["reason"])
    return "", log.read_text(errors="replace").strip().rpartition("\n")[2]
