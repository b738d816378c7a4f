"""The rate at which accuracy can be had for time: variants measured, and the best ways to join.

Nothing that is changed about the scene (poses, field, its frames) changes what the style's stages
do, and the other way round: so each side is measured alone, one variant after the other, and a
combination of two is reckoned. That makes hundreds of points of a few dozen, of which those on the
front are worth a run.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import fmean, stdev
from typing import Any, Literal

from styletrf.errors import InputError

Part = Literal["scene", "style"]
Tuning = Mapping[str, Mapping[str, Any]]
"""Settings by stage."""

FOLLOWING_FRAMES = ("PriorRenders", "StylizedField", "StylizedFrames")
"""Stages of the style whose time follows what a frame of the field costs."""

BUSY_SHARE = 0.1
"""Of the time of the cores, above which other work has disturbed a measurement."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """A variant of one side, measured.

    Attributes:
        part: The side.
        name: What is changed, in words; empty for the quality as it is, also for its repeats.
        tuning: The settings changed.
        quality_db: Of the scene: PSNR of views held out. Of the style: -10 log10 of the style and
            content loss of the stylised frames.
        seconds: By stage.
        other_cpu_share: Of the cores' time, what other work took meanwhile.
        peak_memory_bytes: Of the stage that takes most.
        model_bytes: Of what is kept to render from: the field; or the appearance and the network.
    """

    part: Part
    name: str
    tuning: Tuning
    quality_db: float
    seconds: Mapping[str, float]
    other_cpu_share: float
    peak_memory_bytes: int
    model_bytes: int


@dataclass(frozen=True, slots=True)
class Combination:
    """A variant of the scene with one of the style.

    Attributes:
        scene: The name of the one.
        style: The name of the other.
        tuning: The settings of both.
        shortfall_db: By how much it falls short of the best, on the side where that is more.
        psnr_db: Of the field.
        style_db: Of the style.
        seconds: From photographs and painting to the result.
        seconds_spread: One standard deviation, of repeats.
        peak_memory_bytes: Of the stage that takes most.
        model_bytes: Of all that is kept to render from.
    """

    scene: str
    style: str
    tuning: Tuning
    shortfall_db: float
    psnr_db: float
    style_db: float
    seconds: float
    seconds_spread: float
    peak_memory_bytes: int
    model_bytes: int


@dataclass(frozen=True, slots=True)
class FrontPoint:
    """A combination that no other beats in time and shortfall both.

    Attributes:
        combination: The point.
        overlaps: Whether its time cannot be told from that of a neighbour on the front: two
            standard deviations of the difference are more than it.
    """

    combination: Combination
    overlaps: bool


def merged(*tunings: Tuning) -> dict[str, dict[str, Any]]:
    """Returns the settings of all by stage; the later of two equal names counts."""
    result: dict[str, dict[str, Any]] = {}
    for tuning in tunings:
        for stage, settings in tuning.items():
            result.setdefault(stage, {}).update(settings)
    return result


def spreads(repeats: Sequence[Measurement]) -> dict[str, float]:
    """Returns the standard deviation of each stage's seconds over their mean, where it is known.

    Of `repeats`, which differ in their seeds alone; a stage that ran once among them has none.
    """
    times: dict[str, set[float]] = {}
    for measurement in repeats:
        for stage, seconds in measurement.seconds.items():
            times.setdefault(stage, set()).add(seconds)
    return {s: stdev(t) / fmean(t) for s, t in times.items() if len(t) > 1 and fmean(t) > 0}


def variants(measurements: Sequence[Measurement], part: Part) -> list[Measurement]:
    """Returns the measurements of one side, the unchanged quality first, the mean of its repeats.

    Raises:
        InputError: The unchanged quality is not among them.
    """
    side = [m for m in measurements if m.part == part]
    repeats = [m for m in side if not m.name]
    if not repeats:
        raise InputError("trade-off", "lacks the unchanged quality", "Measure that first")
    stages = dict.fromkeys(stage for m in repeats for stage in m.seconds)
    mean = replace(
        repeats[0],
        tuning={},
        quality_db=fmean(m.quality_db for m in repeats),
        seconds={s: fmean(m.seconds[s] for m in repeats if s in m.seconds) for s in stages},
    )
    return [mean, *(m for m in side if m.name)]


def combinations(measurements: Sequence[Measurement]) -> list[Combination]:
    """Returns every variant of the scene with every variant of the style.

    The seconds are those of both, repeats averaged. Stages that render the field count by the ratio
    of what frames cost (`TrajectoryFrames`) with that field and with the unchanged one.

    Raises:
        InputError: The unchanged quality is not among the measurements, on either side.
    """
    scenes, styles = variants(measurements, "scene"), variants(measurements, "style")
    best = {side[0].part: max(m.quality_db for m in side) for side in (scenes, styles)}
    spread = spreads([m for m in measurements if not m.name])
    frames = scenes[0].seconds.get("TrajectoryFrames", 0.0)
    return [_combined(scene, style, best, spread, frames) for scene in scenes for style in styles]


def _combined(
    scene: Measurement,
    style: Measurement,
    best: Mapping[Part, float],
    spread: Mapping[str, float],
    usual_frames: float,
) -> Combination:
    ratio = scene.seconds.get("TrajectoryFrames", 0.0) / usual_frames if usual_frames else 1.0
    following = {s: ratio * t for s, t in style.seconds.items() if s in FOLLOWING_FRAMES}
    seconds = {**style.seconds, **following, **scene.seconds}
    variance = sum((spread.get(stage, 0.0) * s) ** 2 for stage, s in seconds.items())
    short = max(best["scene"] - scene.quality_db, best["style"] - style.quality_db)
    return Combination(
        scene=scene.name,
        style=style.name,
        tuning=merged(scene.tuning, style.tuning),
        shortfall_db=short,
        psnr_db=scene.quality_db,
        style_db=style.quality_db,
        seconds=sum(seconds.values()),
        seconds_spread=variance**0.5,
        peak_memory_bytes=max(scene.peak_memory_bytes, style.peak_memory_bytes),
        model_bytes=scene.model_bytes + style.model_bytes,
    )


def pareto_front(points: Iterable[Combination]) -> list[FrontPoint]:
    """Returns the points that none beats in time and shortfall, the fastest first."""
    kept: list[Combination] = []
    for point in sorted(points, key=lambda p: (p.seconds, p.shortfall_db)):
        if not kept or point.shortfall_db < kept[-1].shortfall_db:
            kept.append(point)
    pairs = pairwise(kept)
    close = [b.seconds - a.seconds < 2 * _spread_of_difference(a, b) for a, b in pairs]
    told = zip(kept, [False, *close], [*close, False], strict=False)
    return [FrontPoint(point, before or after) for point, before, after in told]


def _spread_of_difference(a: Combination, b: Combination) -> float:
    return float((a.seconds_spread**2 + b.seconds_spread**2) ** 0.5)


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
