"""The records that a command finds in the store. This file reports no failure: a build does."""

import luigi

from pipeline.record import ActionRecord
from pipeline.task import StoredTask


def found_record(task: luigi.Task) -> ActionRecord | None:
    """Returns the record of a task's artifact; None if it is not made, or cannot be."""
    try:
        return task.record() if isinstance(task, StoredTask) else None
    except Exception:  # noqa: BLE001  reported by `find_blocking_failure`
        return None


def is_made(task: luigi.Task) -> bool:
    """Returns whether a task's artifact is recorded."""
    return found_record(task) is not None
