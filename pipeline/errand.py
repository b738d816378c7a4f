"""A task built on another machine: what is asked, and what became of it.

`python -m pipeline.errand ERRAND.json` builds it there and prints an `Outcome` as the last line. It
is an ordinary build of that machine, with what the shared store has, and leaves its artifact there:
a machine that asks twice, or two that build the same, do no harm.
"""

import contextlib
import dataclasses
import importlib
import json
import os
import socket
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pipeline.errors import (
    FailureKind,
    LostInputError,
    NotBuiltError,
    TaskFailure,
    tells_of_full_disk,
)
from pipeline.parent_process import die_with
from pipeline.resources import CORES
from pipeline.settings import PATIENCE, current_remote, current_store, setting
from pipeline.sharing import give

if TYPE_CHECKING:
    from pipeline.task import StoredTask

_SECONDS_OF_PATIENCE = 300.0
NODE = "STYLETRF_NODE"
"""Where a build is told what its engine calls the machine; SLURM has a name of its own for it."""
NO_ENGINE = 69
"""The status of what was to send an errand, and found nobody to send it by."""


@dataclass(frozen=True, slots=True)
class Errand:
    """What a machine is asked to build.

    Attributes:
        module: Where the task's class is.
        task: The class.
        parameters: The task's parameters, serialised.
        key: That of the action, which the other machine must come to, too.
        cores: How many it shall use; fewer where no machine has so many.
        gpus: How many cards; fewer, or none, where no machine has so many.
        memory_bytes: What it is expected to take; 0 if that is unknown.
        folder: Where the command has to run, which has its `luigi.cfg`.
        environment: Variables to set for it.
        rather_not: Machines to leave out where there are others.
    """

    module: str
    task: str
    parameters: Mapping[str, str]
    key: str
    cores: int
    gpus: int
    memory_bytes: int
    folder: str
    environment: Mapping[str, str] = field(default_factory=dict)
    rather_not: tuple[str, ...] = ()

    def to_json(self) -> str:
        """The errand as text."""
        return json.dumps(dataclasses.asdict(self), sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> "Errand":
        """The errand in a text."""
        told = json.loads(text)
        return cls(**told | {"rather_not": tuple(told["rather_not"])})

    @classmethod
    def of(cls, task: "StoredTask", key: str, memory_bytes: int) -> "Errand":
        """What to ask for a task."""
        cores = int(setting("host", "cores"))
        words: dict[str, str] = task.to_str_params()  # type: ignore[no-untyped-call]
        return cls(
            module=type(task).__module__,
            task=type(task).__qualname__,
            parameters=words | {"executor": "subprocess"},
            key=key,
            cores=cores,
            gpus=task.most_cards if task.needs_gpu else 0,
            memory_bytes=memory_bytes,
            folder=str(Path.cwd()),
            environment={
                **{n: value for n, value in os.environ.items() if _goes_along(n)},
                CORES: str(cores),
                PATIENCE: str(current_remote().patience_seconds or _SECONDS_OF_PATIENCE),
                "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
            },
        )


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of an errand.

    Attributes:
        kind: "built", or the kind of `TaskFailure` that it was; "lost" where an input is.
        message: Why it was not built; the task_id of the input that was lost.
        host: Where.
        node: What the engine calls that machine.
    """

    kind: Literal["built", "lost"] | FailureKind
    message: str = ""
    host: str = ""
    node: str = ""


def _goes_along(variable: str) -> bool:
    """Whether it tells where things lie, which the machines call alike; no credentials do."""
    return variable.startswith("STYLETRF_") or variable == "LUIGI_CONFIG_PATH"


def command(errand: Path) -> list[str]:
    """What another machine has to run."""
    return [sys.executable, "-P", "-m", "pipeline.errand", str(errand)]


def outcome_in(said: str) -> Outcome:
    """The outcome in what an errand printed; that of one that was lost if there is none."""
    for line in reversed(said.splitlines()):
        with contextlib.suppress(ValueError, TypeError):
            return Outcome(**json.loads(line))
    return Outcome("killed", f"the machine that was building it was lost: {said[-500:].strip()}")


def perform(errand: Errand) -> Outcome:
    """Build what is asked, here."""
    from pipeline.building import find_or_build

    host = socket.gethostname()
    node = os.environ.get(NODE) or os.environ.get("SLURMD_NODENAME", "")
    try:
        store = current_store()
        task_class: type[StoredTask] = getattr(importlib.import_module(errand.module), errand.task)
        task: StoredTask = task_class.from_str_params(dict(errand.parameters))  # type: ignore[no-untyped-call]
        action = task.action()
        if action.key != errand.key:
            reason = (
                f"{host} has other code, inputs or files than the machine that asks:"
                f" it would build {action.key[:16]}, not {errand.key[:16]}."
                " Give all machines the same commit, packages and data"
            )
            return Outcome("user", reason, host)
        give(store, find_or_build(task, action, store))  # also what was there, and never given
    except LostInputError as lost:
        return Outcome("lost", lost.args[0].task_id, host)
    except NotBuiltError as error:
        return Outcome("lost", str(error), host)
    except TaskFailure as failure:
        return Outcome(failure.kind, failure.reason, host, node)
    except Exception as error:  # noqa: BLE001  it has to be told where it was asked
        kind: FailureKind = "disk" if tells_of_full_disk(error) else "crash"
        return Outcome(kind, f"{type(error).__name__}: {error}", host, node)
    return Outcome("built", host=host)


def main() -> None:
    """Build, and say how it went."""
    die_with(os.getppid())
    outcome = perform(Errand.from_json(Path(sys.argv[1]).read_text()))
    sys.stdout.write(f"\n{json.dumps(dataclasses.asdict(outcome))}\n")


if __name__ == "__main__":
    main()
