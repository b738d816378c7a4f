"""The designed sweep: one change at a time around a preset, and a few combined changes.

Changes are factors of the baseline settings, so that the sweep fits any preset.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from styletrf.errors import InputError
from styletrf.evaluation.trade_off import merged
from tasks.presets.presets import settings_for

Values = Mapping[str, Mapping[str, Any]]
"""Settings by stage."""


@dataclass(frozen=True, slots=True)
class Variant:
    """A change on one side of the graph; without a name, only the seed changes.

    Attributes:
        part: The side.
        name: A description of the change.
        tuning: The settings of the change, by stage.
        stylizer: The stylizer of the priors; empty if the change leaves it as it is.
    """

    part: Literal["scene", "style"]
    name: str
    tuning: Values
    stylizer: str = ""


@dataclass(frozen=True, slots=True)
class SweepAxis:
    """Settings `STAGE/NAME` that change by a common factor, and the factors to measure."""

    part: Literal["scene", "style"]
    name: str
    settings: tuple[str, ...]
    factors: tuple[float, ...]


LOW_WEIGHT_SETTINGS = tuple(
    f"{stage}{name}"
    for stage in ("PriorRenders/render.", "StylizedFrames/")
    for name in ("termination", "min_weight")
)
ADAPTATION_ITERATIONS = tuple(
    f"StylizedField/{part}.iterations" for part in ("adaptation", "image")
)
_SEEDS: dict[Literal["scene", "style"], tuple[str, ...]] = {
    "scene": ("RadianceField/seed",),
    "style": ("StyleNetwork/seed", "StylizedField/adaptation.seed"),
}
_REMEDY = "Leave it out of --tuning"
RANKS = ("RadianceField/field.density_ranks", "RadianceField/field.appearance_ranks")
SWEEP_AXES = (
    SweepAxis("scene", "iterations", ("RadianceField/iterations",), (0.25, 0.5, 2.0)),
    SweepAxis("scene", "batch", ("RadianceField/batch", "RadianceField/batch_samples"), (0.5, 2.0)),
    SweepAxis("scene", "voxels", ("SceneModel/max_voxels",), (0.25, 0.5, 2.0)),
    SweepAxis("scene", "ranks", RANKS, (0.5, 2.0)),
    SweepAxis("scene", "steps a voxel", ("RadianceField/steps_per_voxel",), (0.7,)),
    SweepAxis("scene", "faint samples of the fit", ("RadianceField/min_weight",), (3.0,)),
    SweepAxis("scene", "photographs' size", ("SceneModel/image_long_side",), (0.75,)),
    SweepAxis("scene", "hidden units", ("RadianceField/field.hidden",), (2.0,)),
    SweepAxis("style", "network iterations", ("StyleNetwork/iterations",), (0.25, 0.5, 2.0)),
    SweepAxis("style", "network crops", ("StyleNetwork/crop_px",), (0.75,)),
    SweepAxis("style", "adaptation iterations", ADAPTATION_ITERATIONS, (0.25, 0.5, 2.0)),
    SweepAxis(
        "style", "left out of the cache", ("StylizedField/adaptation.min_weight",), (0.5, 15.0)
    ),
    SweepAxis("style", "faint samples of frames", LOW_WEIGHT_SETTINGS, (3.0, 0.3)),
    SweepAxis("style", "times that priors cover", ("PriorRenders/coverage.times",), (1 / 3, 2.0)),
)
COMBINED_CHANGES: dict[tuple[Literal["scene", "style"], str], dict[str, float]] = {
    ("scene", "quick"): {"iterations": 0.5, "voxels": 0.5, "ranks": 0.5},
    ("scene", "least"): {"iterations": 0.25, "voxels": 0.25, "ranks": 0.5},
    ("scene", "most"): {"iterations": 2.0, "voxels": 2.0, "ranks": 1.5, "hidden units": 2.0},
    ("style", "quick"): {
        "network iterations": 0.5, "adaptation iterations": 0.5, "times that priors cover": 2 / 3,
    },
    ("style", "least"): {
        "network iterations": 0.25, "adaptation iterations": 0.25, "times that priors cover": 1 / 3,
        "faint samples of frames": 3.0,
    },
}  # fmt: skip


CONFIG_DEFAULTS: dict[str, dict[str, Any]] = {
    "RadianceField": {"steps_per_voxel": 0.7, "min_weight": 3e-3},
    "StylizedField": {"adaptation.min_weight": 1e-2},
    "PriorRenders": {"coverage.times": 3},
}
"""Defaults of the configurations that all presets share."""


def baseline_settings(quality: str, tuning: Values) -> dict[str, dict[str, Any]]:
    """Returns the settings of a preset, replaced by those of `tuning`, by stage."""
    stages = {setting.split("/")[0] for axis in SWEEP_AXES for setting in axis.settings}
    of_quality = {stage: settings_for(stage, quality) for stage in sorted(stages)}
    return merged(CONFIG_DEFAULTS, of_quality, tuning)


def sweep(baseline: Values, repeats: int) -> list[Variant]:
    """Returns the variants to measure; the repeated baseline comes first.

    Changes without effect, because a setting is 0 or has its smallest value, are left out.

    Args:
        baseline: The settings that the variants change, see `baseline_settings`.
        repeats: How often the baseline is measured, each time with other seeds.

    Raises:
        InputError: A setting of the baseline is not a number.
    """
    changes = [*_single(baseline), *_combined(baseline)]
    unlike = [variant for variant in changes if not _is_baseline(variant, baseline)]
    return [*_repeated(repeats, baseline), *unlike]


def _repeated(repeats: int, baseline: Values) -> Iterator[Variant]:
    """Yields the baseline, then the same with the seeds that follow its own."""
    for k in range(repeats):
        for part, settings in _SEEDS.items():
            changes = (_seeded(setting, k, baseline) for setting in settings)
            yield Variant(part, "", merged(*changes) if k else {})


def _seeded(setting: str, k: int, baseline: Values) -> dict[str, dict[str, Any]]:
    stage, name = setting.split("/")
    seed = baseline.get(stage, {}).get(name, 0)
    if type(seed) is not int:
        raise InputError(f"setting {setting}", f"{seed!r} is not a whole number", _REMEDY)
    return {stage: {name: seed + k}}


def _single(baseline: Values) -> Iterator[Variant]:
    for axis in SWEEP_AXES:
        for factor in axis.factors:
            yield Variant(
                axis.part, f"{axis.name} x {factor:.2g}", _changed(axis, factor, baseline)
            )
    yield Variant("style", "network in float32", {"StyleNetwork": {"bfloat16": False}})
    yield Variant("style", "painted by arbitrary", {}, stylizer="arbitrary")


def _combined(baseline: Values) -> Iterator[Variant]:
    axes = {axis.name: axis for axis in SWEEP_AXES}
    for (part, name), factors in COMBINED_CHANGES.items():
        changes = (_changed(axes[known], factor, baseline) for known, factor in factors.items())
        yield Variant(part, name, merged(*changes))


def _changed(axis: SweepAxis, factor: float, baseline: Values) -> dict[str, dict[str, Any]]:
    tuning: dict[str, dict[str, Any]] = {}
    for setting in axis.settings:
        stage, name = setting.split("/")
        tuning.setdefault(stage, {})[name] = _times(baseline[stage][name], factor, setting)
    return merged(tuning, _beside(axis, baseline))


def _beside(axis: SweepAxis, baseline: Values) -> Values:
    """Returns further settings that keep the results of a change comparable."""
    if axis.name != "photographs' size":
        return {}
    size = {"long_side_px": baseline["SceneModel"]["image_long_side"]}
    kept = {"TrajectoryFrames": {**size, "enlarged": False}, "QualityMetrics": size}
    return {k: v for k, v in kept.items() if not baseline.get(k, {}).get("long_side_px")}


def _times(value: Any, factor: float, setting: str) -> Any:
    if isinstance(value, list | tuple):
        return [_times(part, factor, setting) for part in value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"setting {setting}", f"{value!r} is not a number", _REMEDY)
    if isinstance(value, float):
        return float(f"{factor * value:.6g}")
    return max(1, round(factor * value)) if value else 0


def _is_baseline(variant: Variant, baseline: Values) -> bool:
    return not variant.stylizer and all(
        baseline.get(stage, {}).get(name) == value
        for stage, settings in variant.tuning.items()
        for name, value in settings.items()
        if name not in ("long_side_px", "enlarged")
    )
