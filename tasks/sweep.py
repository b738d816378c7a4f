"""The designed sweep over the knobs: one change at a time around a quality, and a few together.

Changes are factors of the values in the middle, so that the sweep fits any quality.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from styletrf.errors import InputError
from styletrf.evaluation.trade_off import merged
from tasks.qualities import settings_for

Values = Mapping[str, Mapping[str, Any]]
"""Settings by stage."""


@dataclass(frozen=True, slots=True)
class Variant:
    """What is changed on one side of the graph; the name is empty for nothing but a seed."""

    part: Literal["scene", "style"]
    name: str
    tuning: Values


@dataclass(frozen=True, slots=True)
class Knob:
    """Settings that are changed by one factor: `STAGE/NAME`, and the factors tried."""

    part: Literal["scene", "style"]
    name: str
    settings: tuple[str, ...]
    factors: tuple[float, ...]


FAINT = tuple(
    f"{stage}{name}"
    for stage in ("PriorRenders/render.", "StylizedFrames/")
    for name in ("termination", "min_weight")
)
RANKS = ("RadianceField/field.density_ranks", "RadianceField/field.appearance_ranks")
KNOBS = (
    Knob("scene", "iterations", ("RadianceField/iterations",), (0.25, 0.5, 2.0)),
    Knob("scene", "batch", ("RadianceField/batch", "RadianceField/batch_samples"), (0.5, 2.0)),
    Knob("scene", "voxels", ("SceneModel/max_voxels",), (0.25, 0.5, 2.0)),
    Knob("scene", "ranks", RANKS, (0.5, 2.0)),
    Knob("scene", "steps a voxel", ("RadianceField/steps_per_voxel",), (0.7,)),
    Knob("scene", "faint samples of the fit", ("RadianceField/min_weight",), (3.0,)),
    Knob("scene", "photographs' size", ("SceneModel/image_long_side",), (0.75,)),
    Knob("scene", "hidden units", ("RadianceField/field.hidden",), (2.0,)),
    Knob("style", "network iterations", ("StyleNetwork/iterations",), (0.25, 0.5, 2.0)),
    Knob("style", "network crops", ("StyleNetwork/crop_px",), (0.75,)),
    Knob(
        "style", "adaptation iterations", ("StylizedField/adaptation.iterations",), (0.25, 0.5, 2.0)
    ),
    Knob("style", "left out of the cache", ("StylizedField/adaptation.min_weight",), (0.5, 15.0)),
    Knob("style", "faint samples of frames", FAINT, (3.0, 0.3)),
    Knob("style", "times that priors cover", ("PriorRenders/coverage.times",), (1 / 3, 2.0)),
)
TOGETHER: dict[tuple[Literal["scene", "style"], str], dict[str, float]] = {
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


USUAL: dict[str, dict[str, Any]] = {
    "RadianceField": {"steps_per_voxel": 0.7, "min_weight": 3e-3},
    "StylizedField": {"adaptation.min_weight": 1e-2},
    "PriorRenders": {"coverage.times": 3},
}
"""Defaults of the configurations, where all qualities have them."""


def middle_of(quality: str, tuning: Values) -> dict[str, dict[str, Any]]:
    """Returns the settings of a quality, replaced by those tuned, by stage."""
    stages = {setting.split("/")[0] for knob in KNOBS for setting in knob.settings}
    of_quality = {stage: settings_for(stage, quality) for stage in sorted(stages)}
    return merged(USUAL, of_quality, tuning)


def sweep(middle: Values, repeats: int) -> list[Variant]:
    """Returns the variants to measure, the unchanged middle first and repeated.

    A change that leaves everything as it is, because a setting is 0 or as low as it goes, is left
    out.

    Args:
        middle: The settings around which is swept, see `middle_of`.
        repeats: How often the middle is measured, each time with other seeds.

    Raises:
        InputError: A setting in the middle is no number.
    """
    changes = [*_alone(middle), *_together(middle)]
    return [*_repeated(repeats), *(v for v in changes if not _is_middle(v, middle))]


def _repeated(repeats: int) -> Iterator[Variant]:
    for seed in range(repeats):
        style = {"StyleNetwork": {"seed": seed}, "StylizedField": {"adaptation.seed": seed}}
        yield Variant("scene", "", {"RadianceField": {"seed": seed}} if seed else {})
        yield Variant("style", "", style if seed else {})


def _alone(middle: Values) -> Iterator[Variant]:
    for knob in KNOBS:
        for factor in knob.factors:
            yield Variant(knob.part, f"{knob.name} x {factor:.2g}", _changed(knob, factor, middle))
    yield Variant("style", "network in float32", {"StyleNetwork": {"bfloat16": False}})


def _together(middle: Values) -> Iterator[Variant]:
    knobs = {knob.name: knob for knob in KNOBS}
    for (part, name), factors in TOGETHER.items():
        changes = (_changed(knobs[knob], factor, middle) for knob, factor in factors.items())
        yield Variant(part, name, merged(*changes))


def _changed(knob: Knob, factor: float, middle: Values) -> dict[str, dict[str, Any]]:
    tuning: dict[str, dict[str, Any]] = {}
    for setting in knob.settings:
        stage, name = setting.split("/")
        tuning.setdefault(stage, {})[name] = _times(middle[stage][name], factor, setting)
    return merged(tuning, _beside(knob, middle))


def _beside(knob: Knob, middle: Values) -> Values:
    """What has to go with a change, so that what comes out compares."""
    if knob.name == "photographs' size":  # frames, and views to judge by, keep theirs
        size = {"long_side_px": middle["SceneModel"]["image_long_side"]}
        return dict.fromkeys(("TrajectoryFrames", "PriorRenders", "QualityMetrics"), size)
    return {}


def _times(value: Any, factor: float, setting: str) -> Any:
    if isinstance(value, list | tuple):
        return [_times(part, factor, setting) for part in value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(
            f"setting {setting}", f"{value!r} is no number", "Leave it out of --tuning"
        )
    if isinstance(value, float):
        return float(f"{factor * value:.6g}")
    return max(1, round(factor * value)) if value else 0


def _is_middle(variant: Variant, middle: Values) -> bool:
    return all(
        middle.get(stage, {}).get(name) == value
        for stage, settings in variant.tuning.items()
        for name, value in settings.items()
        if name != "long_side_px"
    )
