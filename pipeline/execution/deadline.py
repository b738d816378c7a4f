"""The deadline `--until`: no build starts that would probably be running at that time."""

from datetime import datetime, timedelta

import luigi
import psutil
from luigi.parameter import ParameterException

from pipeline.errors import TaskFailure
from pipeline.execution.cost_history import Cost


class Deadline(luigi.Parameter["datetime | None"]):
    """A moment: a time of day such as `06:00`, or a date and time in ISO 8601.

    A time of day means its next occurrence after this process started, even if the process runs
    its command line again.
    """

    def parse(self, x: str) -> datetime | None:
        """Returns the moment, in local time if it has no zone; None for an empty string.

        Raises:
            ParameterException: The text is not a moment.
        """
        if not x:
            return None
        try:
            moment = datetime.fromisoformat(x).replace(microsecond=0)
        except ValueError:
            moment = _next_occurrence(x)
        return moment.astimezone()  # with its zone, which may differ on another machine

    def serialize(self, x: datetime | None) -> str:
        """Returns the moment in ISO 8601, with its date and zone."""
        return x.isoformat() if x else ""


def _next_occurrence(clock: str) -> datetime:
    """Returns the next time after the start of the process when a clock shows this."""
    started = datetime.fromtimestamp(psutil.Process().create_time())
    try:
        time_of_day = datetime.strptime(clock, "%H:%M").time()
    except ValueError:
        message = f"--until {clock} is not a time. Give one such as 06:00 or 2026-11-23T06:00"
        raise ParameterException(message) from None
    moment = datetime.combine(started, time_of_day)
    return moment if moment > started else moment + timedelta(days=1)


def require_time_left(task: luigi.Task, until: datetime | None, cost: Cost | None) -> None:
    """Refuses a build that is expected to end after the deadline.

    Args:
        task: The task to build.
        until: The deadline, if there is one.
        cost: The expected cost of the build. If it is unknown, the build may start until the
            deadline.

    Raises:
        TaskFailure: Of kind "late".
    """
    if until is None:
        return
    left_s = (until - datetime.now(until.tzinfo)).total_seconds()
    needed_s = cost.seconds if cost else 0.0
    if needed_s >= left_s:
        expected = f", and it takes about {needed_s:.0f} s" if needed_s else ""
        reason = f"not begun: {max(0.0, left_s):.0f} s are left until {until}{expected}"
        raise TaskFailure("late", str(task), f"{reason}. Run the same command again to continue.")
