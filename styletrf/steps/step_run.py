"""The part of a run that a step uses."""

from dataclasses import dataclass
from pathlib import Path

from styletrf.progress import Progress, silent


@dataclass(frozen=True, slots=True)
class StepRun:
    """The folder, device and progress that a step uses besides its inputs and settings.

    Attributes:
        work: An existing folder for checkpoints, from which an interrupted step continues. It
            belongs to these inputs and settings alone.
        device_name: `auto`, `cpu` or `cuda`.
        progress: Called with the work done.
        log: A file, beside which other programs write their messages; None for standard error.
        shard: The part of the frames to make, such as `2/5`; empty for all.
    """

    work: Path
    device_name: str = "auto"
    progress: Progress = silent
    log: Path | None = None
    shard: str = ""
