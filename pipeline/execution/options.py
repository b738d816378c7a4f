"""Options of how and where a task is built. None of them changes the artifact."""

from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True, slots=True)
class BuildOptions:
    """The options of one build.

    Attributes:
        executor: "inline", "subprocess", or the name of a cluster backend.
        until: The deadline, at which no build may run any more; None without a deadline.
        timeout_seconds: The time after which the build is ended; 0 for no limit.
        memory_limit_bytes: The resident memory at which the build is ended; 0 for no limit.
        max_gpus: How many GPUs it uses at most, if enough are free; 0 for none.
    """

    executor: str = "subprocess"
    until: datetime | None = None
    timeout_seconds: float = 0.0
    memory_limit_bytes: int = 0
    max_gpus: int = 0
