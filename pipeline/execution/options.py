"""How and where a task is built, apart from what decides its artifact."""

from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True, slots=True)
class BuildOptions:
    """The options of one build.

    Attributes:
        executor: "inline", "subprocess", or the name of a cluster backend.
        until: When no build may run any more; None where there is no deadline.
        timeout_seconds: When to end the build, if not 0.
        memory_limit_bytes: The resident memory at which to end it, if not 0.
        max_gpus: How many GPUs it uses where so many are free; 0 for none.
    """

    executor: str = "subprocess"
    until: datetime | None = None
    timeout_seconds: float = 0.0
    memory_limit_bytes: int = 0
    max_gpus: int = 0
