"""Settings from a front, with the times of this machine.

The front is that measured for the scene (`TradeOff`, in `out/SCENE/trade-off/`), or else the one
shipped of a scene whose space is of the same kind: `ndc`, `box` or `unbounded`. A budget that has
time for the default quality as it is gets that quality
(`docs/decisions/0069-a-budget-may-buy-the-default-quality.md`).
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pipeline.task import StoredTask, artifact
from styletrf.errors import InputError
from styletrf.evaluation.trade_off import Combination
from tasks.command.found_records import is_made
from tasks.machine.calibration import Calibration
from tasks.presets.presets import DEFAULT_QUALITY, PRESETS
from tasks.presets.quality_request import QualityRequest

SHIPPED = Path(__file__).with_name("fronts")
UNMEASURED = Combination("", "", {}, math.nan, math.nan, math.nan, math.inf, None, None, 0, 0)
"""A preset as it is, of which nothing was measured."""
_LONGER = 1.25
"""How much longer a fit takes that improves fast (decision 65), which no prediction knows."""


@dataclass(frozen=True, slots=True)
class Front:
    """A measured front.

    Attributes:
        description: Which front it is, and where it was measured.
        quality: The preset around which was swept; a point may name another one.
        points: Its points, with the seconds of the machine that measured them.
        calibration: The calibration of that machine; None where a front does not have it.
        photographs: The number and the size of the photographs of its scene; empty where the front
            does not have them.
        longer: How many times the seconds of a point have to be within a budget.
        scaled_from: The quality and the point whose seconds stand for those of the points; None if
            the points have their own.
    """

    description: str
    quality: str
    points: Sequence[Combination]
    calibration: Calibration | None
    photographs: Mapping[str, int] = field(default_factory=dict)
    longer: float = 1.0
    scaled_from: tuple[str, Combination] | None = None

    def offers(self) -> "list[Front]":
        """Returns what a budget may buy: the default quality, and the front.

        The default quality is a front of one point, whose time is predicted from the best point of
        this front, at the default quality where it has such points. A front that is swept around
        it, or contains it as it is, is offered alone.
        """
        same = [point for point in self.points if self.quality_of(point) == DEFAULT_QUALITY]
        is_contained = any(not (point.tuning or point.stylizer) for point in same)
        if is_contained or PRESETS.index(self.quality) >= PRESETS.index(DEFAULT_QUALITY):
            return [self]
        best = min(same or self.points, key=lambda p: (bool(same and p.stylizer), p.shortfall_db))
        default_quality = replace(
            self,
            description=f"the default quality, with a time predicted from {self.description}",
            quality=DEFAULT_QUALITY,
            points=(UNMEASURED,),
            longer=_LONGER,
            scaled_from=(self.quality_of(best), best),
        )
        return [default_quality, self]

    def quality_of(self, point: Combination) -> str:
        """Returns the preset that the settings of a point change."""
        return point.quality or self.quality

    def without_stylizers(self) -> "Front":
        """Returns the front without its points that have another stylizer than the default."""
        return replace(self, points=[point for point in self.points if not point.stylizer])


Timing = Callable[[Front, Combination], float]
"""Returns the seconds that the settings of a point take here, without what was there before."""


@dataclass(frozen=True, slots=True)
class Choice:
    """A point of a front with the seconds that it takes here."""

    front: Front
    point: Combination

    @property
    def description(self) -> str:
        """Returns the chosen settings, and what they were chosen from, in one line."""
        words = [f"--quality {self.front.quality_of(self.point)}"]
        words += [f"--stylizer {self.point.stylizer}"] if self.point.stylizer else []
        words += [f"--tuning '{json.dumps(self.point.tuning)}'"] if self.point.tuning else []
        expected = [f"about {self.point.seconds:.0f} s on this machine"]
        if math.isnan(self.point.shortfall_db):
            expected += ["up to a quarter more if the fit improves fast"]
        else:
            expected = [f"{self.point.shortfall_db:.2f} dB short of the best", *expected]
        return f"{self.front.description}: {', '.join([' '.join(words), *expected])}"


def fronts_for(measured: Path, space: str | None) -> list[Front]:
    """Returns the fronts that may apply to a scene: one, or all while its space is unknown.

    Args:
        measured: The file of the scene's own front, if it was measured.
        space: The kind of the scene's space; None before it is decided.

    Raises:
        InputError: There is none.
    """
    if measured.exists():
        return [read_front(measured, "the front of this scene")]
    spaces = [space] if space else sorted(path.stem for path in SHIPPED.glob("*.json"))
    paths = [(SHIPPED / f"{each}.json", each) for each in spaces]
    if not all(path.exists() for path, _ in paths):
        problem = f"was never measured for this scene, and none is shipped for {space} space"
        raise InputError("the front of time and quality", problem, "Run TradeOff on the scene")
    return [read_front(path, f"the shipped front for {each} space") for path, each in paths]


def read_front(path: Path, name: str) -> Front:
    """Returns the front in a file that `TradeOff` wrote."""
    front: dict[str, Any] = json.loads(path.read_text())
    where = ("scene", "style", "changes", "measured", "machine")
    return Front(
        description=f"{name} ({', '.join(str(front[each]) for each in where)})",
        quality=str(front["quality"]),
        points=[Combination(**point["combination"]) for point in front["points"]],
        calibration=Calibration.from_json(front["calibration"]) if "calibration" in front else None,
        photographs=front.get("photographs", {}),
    )


def choose(request: QualityRequest, front: Front, timing: Timing) -> Choice:
    """Returns the requested point of a front: the best in time, or the fastest within.

    In time, the default quality as it is is better than all points of a front of a lower one.

    Raises:
        InputError: No point of that front meets the bound; of a time, it names the nearest.
    """
    if request.budget_s is None:
        good = [p for p in front.points if p.shortfall_db <= (request.within_db or 0.0)]
        timed = [replace(point, seconds=timing(front, point)) for point in good]
        return Choice(front, request.fastest_of(timed))
    for offer in front.offers():
        for point in sorted(offer.points, key=by_quality):
            if offer.longer * (seconds := timing(offer, point)) <= request.budget_s:
                return Choice(offer, replace(point, seconds=seconds))
    raise request.unreachable(min(timing(front, point) for point in front.points))


def by_quality(point: Combination) -> tuple[float, float]:
    """Returns a key that sorts the best first: the lesser side decides, and both among equals."""
    return point.shortfall_db, -(point.psnr_db + point.style_db)


def require_reachable(request: QualityRequest, fronts: Sequence[Front], timing: Timing) -> None:
    """Refuses a bound that no point of any of the fronts keeps to.

    Raises:
        InputError: Of a budget, it names the nearest that can be reached.
    """
    if request.budget_s is None:
        request.fastest_of([point for front in fronts for point in front.points])
        return
    offers = [(offer, point) for f in fronts for offer in f.offers() for point in offer.points]
    offers.sort(key=lambda pair: pair[1].seconds)  # the first is the likeliest
    least_s = math.inf
    for offer, point in offers:
        if (seconds := offer.longer * timing(offer, point)) <= request.budget_s:
            return
        least_s = min(least_s, seconds)
    raise request.unreachable(least_s)


def slowest_choice(request: QualityRequest, fronts: Sequence[Front], timing: Timing) -> Choice:
    """Returns the slowest of the choices from fronts of which one will hold.

    Raises:
        InputError: As `require_reachable`.
    """
    require_reachable(request, fronts, timing)
    choices = []
    for front in fronts:
        with suppress(InputError):
            choices.append(choose(request, front, timing))
    return max(choices, key=lambda choice: choice.point.seconds)


def known_space(model: StoredTask) -> str | None:
    """Returns the kind of space of a scene model; None before it is decided.

    Raises:
        StoreError: The shared store does not return the scene model.
        OSError: The disk of this machine is full.
    """
    if not is_made(model):
        return None
    scene = json.loads((artifact(model) / "scene.json").read_text())
    return str(scene["evidence"]["space"]["chosen"])
