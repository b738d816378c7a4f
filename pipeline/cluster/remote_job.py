"""A build that a node of a cluster runs, and its result, as JSON for other machines.

The same job may run twice, on one node or on two. Each run is an ordinary build into the shared
store, where the first result stays.
"""

import contextlib
import dataclasses
import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from pipeline.errors import FailureKind

NODE = "STYLETRF_NODE"
"""The variable with the name of a node in a Ray cluster; SLURM sets its own variable."""


@dataclass(frozen=True, slots=True)
class RemoteJob:
    """A task to build, and the cores, GPUs and memory that its build needs.

    Attributes:
        module: The module that defines the task's class.
        task: The name of the class.
        parameters: The task's parameters, serialized.
        key: The key of the action. The node builds only if it computes the same key.
        cores: How many cores the build uses; fewer if no node has so many.
        gpus: How many GPUs the build uses; fewer, or none, if no node has so many.
        memory_bytes: The memory the build is expected to take; 0 if that is unknown.
        folder: The working directory, which holds `luigi.cfg`.
        environment: The variables to set.
        excluded_nodes: The nodes to avoid while there are others.
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
    excluded_nodes: tuple[str, ...] = ()

    def to_json(self) -> str:
        """Returns the job as text."""
        return json.dumps(dataclasses.asdict(self), sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> "RemoteJob":
        """Reads the job that `to_json` wrote."""
        fields = json.loads(text)
        return cls(**fields | {"excluded_nodes": tuple(fields["excluded_nodes"])})


@dataclass(frozen=True, slots=True)
class JobResult:
    """The outcome of a remote job.

    Attributes:
        kind: "built"; "lost" if an input is missing; otherwise the kind of the `TaskFailure`.
        message: The reason of a failure; the task_id of an input that is missing.
        host: The name of the machine that ran the job.
        node: The name of that machine in the cluster.
    """

    kind: Literal["built", "lost"] | FailureKind
    message: str = ""
    host: str = ""
    node: str = ""

    def to_json(self) -> str:
        """Returns the result as one line of text."""
        return json.dumps(dataclasses.asdict(self))

    @classmethod
    def from_output(cls, output: str) -> "JobResult":
        """Returns the last result in a job's output; without one, the machine was lost."""
        for line in reversed(output.splitlines()):
            with contextlib.suppress(ValueError, TypeError):
                return cls(**json.loads(line))
        end = output[-500:].strip()
        return cls("killed", f"the machine that was building it was lost: {end}")


def runner_command(job_file: Path) -> list[str]:
    """Returns the command that runs the job in a file on a node."""
    return [sys.executable, "-P", "-m", "pipeline.cluster.job_runner", str(job_file)]
