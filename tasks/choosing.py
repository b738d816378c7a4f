"""Settings from a front: `--quality "within 0.5 dB"` and `--budget 5min` of the main command.

The front is that measured for the scene (`TradeOff`, in `out/SCENE/trade-off/`), or else the one
shipped of a scene whose space is of the same kind: `ndc`, `box` or `unbounded`.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.parameters import ChoiceParameter
from styletrf.errors import InputError
from styletrf.evaluation.pareto_front import best_in, fastest_within
from styletrf.evaluation.trade_off import Combination

SHIPPED = Path(__file__).with_name("fronts")
_WITHIN = re.compile(r"within\s+(\d+(?:\.\d+)?)\s*dB", re.IGNORECASE)
_TIME = re.compile(r"(\d+(?:\.\d+)?)\s*(s|min|h)")
_SECONDS = {"s": 1, "min": 60, "h": 3600}


@dataclass(frozen=True, slots=True)
class Wish:
    """What the user wants of time and accuracy; one of both."""

    within_db: float | None = None
    budget_s: float | None = None

    def answer(self, points: list[Combination]) -> Combination:
        """Returns the point to take.

        Raises:
            InputError: None will do.
        """
        if self.within_db is not None:
            return fastest_within(points, self.within_db)
        return best_in(points, self.budget_s or 0.0)


@dataclass(frozen=True, slots=True)
class Choice:
    """A point of a front, and which front that is."""

    quality: str
    point: Combination
    front: str

    @property
    def told(self) -> str:
        """What was chosen, in a line."""
        return (
            f"{self.front}: --quality {self.quality} --tuning '{json.dumps(self.point.tuning)}',"
            f" {self.point.shortfall_db:.2f} dB short of the best in"
            f" {self.point.seconds:.0f} s there"
        )


def wish_of(quality: str, budget: str) -> Wish | None:
    """Returns what `--quality` and `--budget` wish for; None where the quality is one by name.

    Raises:
        InputError: The budget is no time, or both wish.
    """
    within = _WITHIN.fullmatch(quality.strip())
    if within and budget:
        problem = "are two wishes, of which one can be had"
        raise InputError(f"--quality {quality!r} --budget {budget}", problem, "Leave one out")
    if within:
        return Wish(within_db=float(within[1]))
    if not budget:
        return None
    time = _TIME.fullmatch(budget.strip())
    if not time:
        raise InputError(f"--budget {budget}", "is no time", "Give such as 90s, 5min or 2h")
    return Wish(budget_s=float(time[1]) * _SECONDS[time[2]])


class WishedQuality(ChoiceParameter):
    """A quality by its name, or `within ... dB`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.allowed += ', or such as "within 0.5 dB"'

    def normalize(self, var: str) -> str:
        """Returns the words, if they are either."""
        if _WITHIN.fullmatch(var.strip()):
            return var
        return str(super().normalize(var))  # type: ignore[no-untyped-call]


def choose(wish: Wish, measured: Path, space: str) -> Choice:
    """Returns the point of the front that fits the scene best.

    Args:
        wish: What is wanted.
        measured: Where the scene's own front is, if it was measured.
        space: The kind of the scene's space.

    Raises:
        InputError: No point of that front will do.
    """
    path = measured if measured.exists() else SHIPPED / f"{space}.json"
    if not path.exists():
        problem = f"was never measured for this scene, and none is shipped for {space} space"
        raise InputError("the front of time and accuracy", problem, "Run TradeOff on the scene")
    front: dict[str, Any] = json.loads(path.read_text())
    points = [Combination(**point["combination"]) for point in front["points"]]
    own = "the front of this scene" if path == measured else f"the shipped front for {space} space"
    where = ("scene", "style", "changes", "measured", "machine")
    name = f"{own} ({', '.join(str(front[name]) for name in where)})"
    return Choice(str(front["quality"]), wish.answer(points), name)


def space_of(model: Mapping[str, Any]) -> str:
    """Returns the kind of space that a `scene.json` has."""
    return str(model["evidence"]["space"]["chosen"])
