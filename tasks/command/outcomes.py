"""The outcome of a requested task, for the pages and messages of a command."""

from dataclasses import dataclass
from datetime import datetime
from typing import Literal, TypeAlias

import luigi

from pipeline.maintenance.attempts import EPOCH, find_blocking_failure
from pipeline.settings import current_store
from pipeline.task import StoredTask

Outcome: TypeAlias = Literal["made", "found", "failed", "under way", "late", "not begun"]
"""Made since the command began or found; failed; under way; late: skipped for `--until`."""


@dataclass(frozen=True, slots=True)
class TaskOutcome:
    """The outcome of a task that is not made.

    Attributes:
        outcome: The outcome.
        stage: The stage that failed, was skipped or is under way: the task, or one that it needs.
            None if nothing failed or is under way.
        reason: The last report of that stage.
    """

    outcome: Outcome
    stage: StoredTask | None = None
    reason: str = ""

    @property
    def explanation(self) -> str:
        """Returns the stage and its reason in one line."""
        if self.stage is None:
            return "no attempt on this machine has failed or is under way"
        return f"{self.stage.task_family}: {self.reason}" if self.reason else self.stage.task_family


def outcome_of_missing(task: luigi.Task, since: datetime = EPOCH) -> TaskOutcome:
    """Returns the outcome of a task that is not made, by the attempts of this machine.

    Args:
        task: The task.
        since: When its command began. Earlier failures do not count.
    """
    problem = find_blocking_failure(task, current_store(), since)
    if problem is None:
        return TaskOutcome("not begun")
    ended: Outcome = "late" if problem.kind == "late" else "failed"
    outcome: Outcome = "under way" if problem.is_under_way else ended
    return TaskOutcome(outcome, problem.task, problem.reason)
