"""When a night ends: nothing is begun that would still be running then."""

from datetime import datetime, timedelta
from typing import TYPE_CHECKING, cast

import luigi
import psutil
from luigi.parameter import ParameterException

from pipeline.costs import Cost
from pipeline.errors import TaskFailure
from pipeline.store import Store

if TYPE_CHECKING:
    from pipeline.task import StoredTask


NOT_BEGUN = "not begun"
"""How the reason begins of what was late."""


class Until(luigi.Parameter["datetime | None"]):
    """A moment: the next time a clock shows `06:00`, or a date and time as ISO 8601 has it.

    The next time after this process began, which may run its command line anew.
    """

    def parse(self, x: str) -> datetime | None:
        """The moment, in local time where no zone is told; None for an empty word.

        Raises:
            ParameterException: It is neither.
        """
        if not x:
            return None
        try:
            moment = datetime.fromisoformat(x).replace(microsecond=0)
        except ValueError:
            moment = _next(x)
        return moment.astimezone()  # with its zone, which another machine need not share

    def serialize(self, x: datetime | None) -> str:
        """The moment as ISO 8601 has it, which means the same tomorrow."""
        return x.isoformat() if x else ""


def _next(clock: str) -> datetime:
    begun = datetime.fromtimestamp(psutil.Process().create_time())
    try:
        told = datetime.strptime(clock, "%H:%M").time()
    except ValueError:
        message = f"--until {clock} is no time of day. Give one such as 06:00 or 2026-11-23T06:00"
        raise ParameterException(message) from None
    moment = datetime.combine(begun, told)
    return moment if moment > begun else moment + timedelta(days=1)


def require_time(task: "StoredTask", key: str, cost: Cost | None, store: Store) -> None:
    """Refuses to begin what would not end in time, as far as earlier builds tell; a log says so.

    Raises:
        TaskFailure: It would not.
    """
    until = cast("datetime | None", task.until)
    if until is None:
        return
    left = (until - datetime.now(until.tzinfo)).total_seconds()
    needed = cost.seconds if cost else 0.0
    if needed >= left:
        expected = f", and it takes about {needed:.0f} s" if needed else ""
        reason = f"{NOT_BEGUN}: {max(0.0, left):.0f} s are left until {until}{expected}"
        store.new_log(task.task_family, key).write_text(f"{reason}\n")
        raise TaskFailure("late", str(task), f"{reason}. Run the same command again to go on.")
