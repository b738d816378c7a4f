"""Where a task's artifact lies."""

from pathlib import Path
from typing import TYPE_CHECKING

import luigi

from pipeline.errors import NotBuiltError
from pipeline.settings import current_store
from pipeline.sharing import fetch

if TYPE_CHECKING:
    from pipeline.task import StoredTask


class StoreTarget(luigi.Target):
    """The place of a task's artifact; unknown, and absent, until the task's inputs are known."""

    def __init__(self, task: "StoredTask") -> None:
        self.task = task

    def exists(self) -> bool:
        """Whether the artifact can be had; never raises."""
        return self.task.complete()

    @property
    def path(self) -> Path:
        """The artifact's directory, read-only; not there yet, if only the shared store has it.

        Raises:
            NotBuiltError: When it is not built.
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


def artifact(task: "StoredTask") -> Path:
    """The directory of a finished task's artifact, read-only; fetched, if it is not here yet.

    Raises:
        NotBuiltError: When it is not built, or the shared store does not give it.
    """
    path, record = StoreTarget(task).path, task.record()
    if not (record and fetch(current_store(), record)):
        raise NotBuiltError(f"{task} cannot be fetched. Run the same command again.")
    return path
