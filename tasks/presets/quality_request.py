"""The user's request for time or quality: `--quality "within 0.5 dB"` or `--budget 5min`."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.parameters import ChoiceParameter
from styletrf.errors import InputError
from styletrf.evaluation.pareto_front import fastest_within
from styletrf.evaluation.trade_off import Combination

_WITHIN = re.compile(r"within\s+(\d+(?:\.\d+)?)\s*dB", re.IGNORECASE)
_TIME = re.compile(r"(\d+(?:\.\d+)?)\s*(s|min|h)")
_SECONDS = {"s": 1, "min": 60, "h": 3600}


@dataclass(frozen=True, slots=True)
class QualityRequest:
    """A bound on the shortfall or on the time; one of both."""

    within_db: float | None = None
    budget_s: float | None = None

    def fastest_of(self, points: Sequence[Combination]) -> Combination:
        """Returns the fastest point within the shortfall.

        Raises:
            InputError: There is none.
        """
        return fastest_within(points, self.within_db or 0.0)

    def unreachable(self, least_s: float) -> InputError:
        """Returns the error for a budget below the seconds of the fastest settings."""
        return InputError(
            f"--budget {self.budget_s:g}s",
            "cannot be reached on this machine by any measured settings",
            f"The nearest that can is --budget {math.ceil(least_s)}s",
        )


def quality_request(quality: str, budget: str) -> QualityRequest | None:
    """Returns the request of `--quality` and `--budget`; None for a preset by its name.

    Raises:
        InputError: The budget is not a time, or both have a bound.
    """
    within = _WITHIN.fullmatch(quality.strip())
    if within and budget:
        problem = "bound both quality and time, of which one can be chosen"
        raise InputError(f"--quality {quality!r} --budget {budget}", problem, "Leave one out")
    if within:
        return QualityRequest(within_db=float(within[1]))
    if not budget:
        return None
    time = _TIME.fullmatch(budget.strip())
    if not time:
        raise InputError(f"--budget {budget}", "is not a time", "Give one such as 90s or 5min")
    return QualityRequest(budget_s=float(time[1]) * _SECONDS[time[2]])


class QualityParameter(ChoiceParameter):
    """A quality by its name, or `within ... dB`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.allowed += ', or such as "within 0.5 dB"'

    def normalize(self, var: str) -> str:
        """Returns the value, if it is either."""
        if _WITHIN.fullmatch(var.strip()):
            return var
        return str(super().normalize(var))  # type: ignore[no-untyped-call]
