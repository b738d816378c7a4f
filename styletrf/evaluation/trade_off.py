"""The speed/quality trade-off: measured variants and predicted combinations.

Settings of the scene (poses, field, frames) do not change the stages of the style, and the other
way round. So each side is measured separately, and the time and quality of each combination are
predicted from the two: a few dozen measurements give hundreds of points.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import fmean, stdev
from typing import Any, Literal

from styletrf.errors import InputError

Part = Literal["scene", "style"]
Tuning = Mapping[str, Mapping[str, Any]]
"""Settings by stage."""

FOLLOWING_FRAMES = ("PriorRenders", "StylizedFrames")
"""Stages of the style whose time follows what a frame of the field costs."""

BUSY_FRACTION = 0.1
"""Of the time of the cores, above which other work has disturbed a measurement."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """A variant of one side, measured.

    Attributes:
        part: The side.
        name: The change in words; empty for the unchanged quality, also for its repeats.
        tuning: The settings changed.
        quality_db: For the scene, the PSNR of held-out views. For the style, the mean of `loss_db`
            and `resemblance_db`.
        seconds: The seconds by stage.
        other_cpu_share: The fraction of the cores' time that other work took meanwhile; None if
            unknown.
        peak_memory_bytes: Of the stage that takes most.
        model_bytes: The bytes of the artifacts that frames are rendered from, by stage.
        loss_db: For the style, -10 log10 of the style and content loss of the stylized frames.
        resemblance_db: For the style, -10 log10 of how far the stylized frames are from the
            painting, over the unstylized ones, by measures that no training used.
        consistency_ratio: For the style, the error of neighboring stylized frames, warped along the
            depth, over the floor of that measure.
        stylizer: What paints the priors; empty if the variant leaves it as it is.
    """

    part: Part
    name: str
    tuning: Tuning
    quality_db: float
    seconds: Mapping[str, float]
    other_cpu_share: float | None
    peak_memory_bytes: int
    model_bytes: Mapping[str, int]
    loss_db: float | None = None
    resemblance_db: float | None = None
    consistency_ratio: float | None = None
    stylizer: str = ""


@dataclass(frozen=True, slots=True)
class Combination:
    """A variant of the scene with one of the style.

    Attributes:
        scene: The name of the scene's variant.
        style: The name of the style's variant.
        tuning: The settings of both.
        shortfall_db: The shortfall from the best, on the side where that is more.
        psnr_db: The PSNR of the field.
        style_db: The quality of the style.
        seconds: The seconds from photographs and painting to the result.
        seconds_spread: One standard deviation, by the repeats; None without them.
        other_cpu_share: That of the measurement that was disturbed more; None if one is unknown.
        peak_memory_bytes: Of the stage that takes most.
        model_bytes: The bytes of all artifacts that frames are rendered from.
        stage_seconds: The seconds by stage, where they are known.
        consistency_ratio: That of the style's measurement; None if it was not measured.
        stylizer: What paints the priors; empty if it stays as it is.
        quality: The preset that `tuning` changes; empty for the one that was swept.
    """

    scene: str
    style: str
    tuning: Tuning
    shortfall_db: float
    psnr_db: float
    style_db: float
    seconds: float
    seconds_spread: float | None
    other_cpu_share: float | None
    peak_memory_bytes: int
    model_bytes: int
    stage_seconds: Mapping[str, float] = field(default_factory=dict)
    consistency_ratio: float | None = None
    stylizer: str = ""
    quality: str = ""


@dataclass(frozen=True, slots=True)
class Spread:
    """The differences between repeats with other seeds, one standard deviation.

    Attributes:
        seconds: By stage, over their mean; of the stages that ran more than once.
        quality_db: By side; of the sides that were measured more than once.
    """

    seconds: Mapping[str, float]
    quality_db: Mapping[Part, float]


def merged(*tunings: Tuning) -> dict[str, dict[str, Any]]:
    """Returns the settings of all by stage; the later of two equal names counts."""
    result: dict[str, dict[str, Any]] = {}
    for tuning in tunings:
        for stage, settings in tuning.items():
            result.setdefault(stage, {}).update(settings)
    return result


def spread_of(measurements: Iterable[Measurement]) -> Spread:
    """Returns the spread of the repeats of the unchanged quality among the measurements."""
    times: dict[str, set[float]] = {}
    qualities: dict[Part, list[float]] = {}
    for measurement in (m for m in measurements if not m.name):
        qualities.setdefault(measurement.part, []).append(measurement.quality_db)
        for stage, seconds in measurement.seconds.items():
            times.setdefault(stage, set()).add(seconds)
    return Spread(
        {s: stdev(t) / fmean(t) for s, t in times.items() if len(t) > 1},
        {part: stdev(q) for part, q in qualities.items() if len(q) > 1},
    )


def variants(measurements: Sequence[Measurement], part: Part) -> list[Measurement]:
    """Returns the measurements of one side, the unchanged quality first, the mean of its repeats.

    Its memory, and the time that other work took, are those of the repeat that has most.
    A stage that a change shares with a repeat, being the very same artifact, took the mean as well.

    Raises:
        InputError: The unchanged quality is not among them.
    """
    side = [m for m in measurements if m.part == part]
    repeats = [m for m in side if not m.name]
    if not repeats:
        raise InputError("trade-off", "lacks the unchanged quality", "Measure that first")
    took: dict[str, list[float]] = {}
    for stage, seconds in (item for m in repeats for item in m.seconds.items()):
        took.setdefault(stage, []).append(seconds)
    usual = {stage: fmean(seconds) for stage, seconds in took.items()}
    quality_db = fmean(m.quality_db for m in repeats)
    ratios = [m.consistency_ratio for m in repeats if m.consistency_ratio is not None]
    mean = replace(
        repeats[0],
        tuning={},
        quality_db=quality_db,
        seconds=usual,
        other_cpu_share=_most_disturbed(repeats),
        peak_memory_bytes=max(m.peak_memory_bytes for m in repeats),
        consistency_ratio=fmean(ratios) if ratios else None,
    )
    return [mean, *(replace(m, seconds=_shared(m, took, usual)) for m in side if m.name)]


def _most_disturbed(measurements: Sequence[Measurement]) -> float | None:
    fractions = [m.other_cpu_share for m in measurements]
    known = [fraction for fraction in fractions if fraction is not None]
    return max(known) if len(known) == len(fractions) else None


def _shared(
    changed: Measurement, took: Mapping[str, Sequence[float]], usual: Mapping[str, float]
) -> dict[str, float]:
    return {s: usual[s] if t in took.get(s, ()) else t for s, t in changed.seconds.items()}


def combinations(measurements: Sequence[Measurement]) -> list[Combination]:
    """Returns every variant of the scene with every variant of the style.

    The seconds are those of both, repeats averaged. Stages that render the field count by the ratio
    of the costs of frames (`TrajectoryFrames`) with that field and with the unchanged one; an
    appearance by the ratio of the fields' bytes. Memory is not scaled.

    Raises:
        InputError: The unchanged quality is not among the measurements, on either side.
    """
    scenes, styles = variants(measurements, "scene"), variants(measurements, "style")
    best = {side[0].part: max(m.quality_db for m in side) for side in (scenes, styles)}
    spread = spread_of(measurements)
    return [
        _combined((scene, style), (scenes[0], styles[0]), best, spread)
        for scene in scenes
        for style in styles
    ]


def _combined(
    pair: tuple[Measurement, Measurement],
    usual: tuple[Measurement, Measurement],
    best: Mapping[Part, float],
    spread: Spread,
) -> Combination:
    scene, style = pair
    short = max(best[m.part] - m.quality_db for m in pair)
    seconds = stage_seconds(scene, style, usual[0])
    known = [spread.seconds[s] * t for s, t in seconds.items() if s in spread.seconds]
    return Combination(
        scene=scene.name,
        style=style.name,
        tuning=merged(scene.tuning, style.tuning),
        shortfall_db=short,
        psnr_db=scene.quality_db,
        style_db=style.quality_db,
        seconds=sum(seconds.values()),
        seconds_spread=sum(t**2 for t in known) ** 0.5 if known else None,
        other_cpu_share=_most_disturbed(pair),
        peak_memory_bytes=max(m.peak_memory_bytes for m in pair),
        model_bytes=_bytes_kept(scene, style, usual[0]),
        stage_seconds=seconds,
        consistency_ratio=style.consistency_ratio,
        stylizer=style.stylizer,
    )


def stage_seconds(
    scene: Measurement, style: Measurement, usual_scene: Measurement
) -> dict[str, float]:
    """Returns the seconds of each stage of two variants together."""
    usual = usual_scene.seconds.get("TrajectoryFrames", 0.0)
    ratio = scene.seconds.get("TrajectoryFrames", 0.0) / usual if usual else 1.0
    following = {s: ratio * t for s, t in style.seconds.items() if s in FOLLOWING_FRAMES}
    return {**style.seconds, **following, **scene.seconds}


def _bytes_kept(scene: Measurement, style: Measurement, usual_scene: Measurement) -> int:
    """An appearance has as many numbers as that of the field it belongs to."""
    usual = usual_scene.model_bytes.get("RadianceField", 0)
    ratio = scene.model_bytes.get("RadianceField", 0) / usual if usual else 1.0
    of_style = {**style.model_bytes}
    of_style["StylizedField"] = round(ratio * of_style.get("StylizedField", 0))
    return sum(scene.model_bytes.values()) + sum(of_style.values())
