"""Finds the Pareto front of the combinations, and the points on it that answer common questions."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from styletrf.errors import InputError
from styletrf.evaluation.trade_off import (
    Combination,
    Measurement,
    Spread,
    spread_of,
    stage_seconds,
    variants,
)


@dataclass(frozen=True, slots=True)
class FrontPoint:
    """A combination that no other beats in time and shortfall both.

    Attributes:
        combination: The point.
        overlaps: Whether its time or its shortfall cannot be distinguished from that of a neighbor
            on the front: two standard deviations of the difference are more than it. None without
            repeats.
    """

    combination: Combination
    overlaps: bool | None


def pareto_front(
    points: Iterable[Combination], measurements: Sequence[Measurement]
) -> list[FrontPoint]:
    """Returns the points that none beats in time and shortfall, the fastest first.

    Args:
        points: The points that `combinations` returned for the measurements.
        measurements: The measurements, whose repeats show how large the noise is.
    """
    kept: list[Combination] = []
    for point in sorted(points, key=lambda p: (p.seconds, p.shortfall_db)):
        if not kept or point.shortfall_db < kept[-1].shortfall_db:
            kept.append(point)
    spread = spread_of(measurements)
    if not spread.seconds:
        return [FrontPoint(point, None) for point in kept]
    close = [_is_close(a, b, measurements, spread) for a, b in pairwise(kept)]
    marked = zip(kept, [False, *close], [*close, False], strict=True)
    return [FrontPoint(point, before or after) for point, before, after in marked]


def _is_close(
    a: Combination, b: Combination, measurements: Sequence[Measurement], spread: Spread
) -> bool:
    """Returns whether two standard deviations of the difference cover it, in time or in shortfall.

    Stages that both share took the very same time, so only those that differ count.
    """
    scenes, styles = (
        {m.name: m for m in variants(measurements, part)} for part in ("scene", "style")
    )
    one, other = (stage_seconds(scenes[p.scene], styles[p.style], scenes[""]) for p in (a, b))
    differing = [s for s in {*one, *other} if one.get(s) != other.get(s)]
    variance = sum(
        (spread.seconds.get(s, 0.0) * t.get(s, 0.0)) ** 2 for s in differing for t in (one, other)
    )
    noise = max(spread.quality_db.values(), default=0.0)
    return (
        b.seconds - a.seconds < 2 * variance**0.5
        or a.shortfall_db - b.shortfall_db < 2 * 2**0.5 * noise
    )


def fastest_within(points: Iterable[Combination], shortfall_db: float) -> Combination:
    """Returns the fastest point that falls short of the best by no more than so much.

    Raises:
        InputError: There is none.
    """
    good = (p for p in points if p.shortfall_db <= shortfall_db)
    return _least(good, lambda p: (p.seconds, p.shortfall_db), f"within {shortfall_db:g} dB")


def best_in(points: Iterable[Combination], seconds: float) -> Combination:
    """Returns the point that falls short of the best by least, of those that take no longer.

    Raises:
        InputError: All take longer.
    """
    quick = (p for p in points if p.seconds <= seconds)
    return _least(quick, lambda p: (p.shortfall_db, p.seconds), f"in {seconds:g} s")


def smallest_within(points: Iterable[Combination], shortfall_db: float) -> Combination:
    """Returns the point that keeps the fewest bytes, of those within so much of the best.

    Raises:
        InputError: There is none.
    """
    good = (p for p in points if p.shortfall_db <= shortfall_db)
    return _least(good, lambda p: (p.model_bytes, p.seconds), f"within {shortfall_db:g} dB")


def _least(
    points: Iterable[Combination], measure: Callable[[Combination], tuple[float, float]], asked: str
) -> Combination:
    found = min(points, key=measure, default=None)
    if found is None:
        raise InputError(f"trade-off {asked}", "has no such point", "Ask for less, or for longer")
    return found
