"""Predicts how much longer a stage takes with other settings, or for another scene.

A stage is taken to need a constant time to start, and beyond it seconds in proportion to

    product over its drivers of value ** exponent,

where a driver is a setting or a size (`tasks.planning.stage_drivers`). The exponents are rounded
from sweeps of single settings (`benchmarks/history.md`, "Time against accuracy"), and are 1 where a
stage does the same for every photograph, frame or pixel. That of the pixels of features is from
three captures of 20 to 62 photographs, and that of features, of which frames of videos have fewer,
from clips of a minute. Other settings are taken to leave the time as it is.
"""

from collections.abc import Mapping

import luigi

from tasks.stages.style import StyleNetwork
from tasks.stages.stylization import StylizedField

START_S = 1.5
"""Seconds of a stage in which its interpreter starts and its libraries load, where measured."""
WHOLE_FIT = "RadianceField"
"""The work of a fit of all of a field."""
UNTRAINED = "StyleNetwork as given"
"""The work of a style network that is not trained here: only the start of a stage."""
OPTIMIZATION_ITERATIONS = 80
"""The default of `iterations` of `StylizedPriors`, the sum at both sizes."""
PRIORS, PRIOR_PIXELS = 13, 504 * 378
"""The number of the priors of horns at `draft`, and the pixels of one."""
COVERAGE_EXPONENT = 0.3
"""The exponent of `coverage.times` in the number of priors."""

EXPONENTS: dict[str, dict[str, float]] = {
    "SceneCapture": {"copied_photographs": 1, "filmed_pixels": 1},
    "CameraPoses": {"photographs": 1, "feature_pixels": 0.7, "features": 0.6},
    "SceneModel": {"photographs": 1},
    "ContentImages": {"count": 1},
    "RadianceField": {
        "iterations": 0.9, "batch": 0.6, "max_voxels": 1 / 3, "field.appearance_ranks": 1 / 3,
    },
    "QualityMetrics": {"photographs": 1, "photograph_pixels": 1, "field.appearance_ranks": 1 / 3},
    "TrajectoryFrames": {"frames": 1, "frame_pixels": 1, "field.appearance_ranks": 1 / 3},
    "PriorRenders": {
        "coverage.times": COVERAGE_EXPONENT, "frame_pixels": 1, "field.appearance_ranks": 1 / 3,
    },
    "StyleNetwork": {"iterations": 0.9, "batch": 0.9, "crop_px": 1.3},
    "StylizedPriors": {"coverage.times": COVERAGE_EXPONENT, "frame_pixels": 1, "iterations": 1},
    "StylizedField": {
        "adaptation.iterations": 0.1, "image.iterations": 0.7, "coverage.times": 0.2,
        "frame_pixels": 0.7, "field.appearance_ranks": 1 / 3,
    },
    "StylizedFrames": {"frames": 1, "frame_pixels": 1, "field.appearance_ranks": 1 / 3},
    "ConsistencyMetrics": {"pairs": 1, "frame_pixels": 1},
    "StyleMetrics": {"frame_pixels": 1},
}  # fmt: skip
"""The exponents by stage and driver; `field.appearance_ranks` are the sum of the list."""

ADDED_S: dict[str, dict[str, float]] = {
    "SceneCapture": {"filmed_pixels": 1.2e-8},
    "StylizedPriors": {"optimized_pixels": 588 / (OPTIMIZATION_ITERATIONS * PRIORS * PRIOR_PIXELS)},
}
"""Seconds for a unit of a driver of which the reference has none, on its machine.

Two cores decode a minute of 1920x1080 at 30 frames a second, and follow its motion, in 46 s. They
paint the 13 priors of horns by an optimization in 588 s (`benchmarks/history.md`).
"""


def work_of(stage: luigi.Task) -> str:
    """Returns the name of the work of a stage: its family, or another one with the same work.

    Stages of a family whose work has different names are not comparable.
    """
    if isinstance(stage, StylizedField) and stage.strategy != "s3":
        return WHOLE_FIT  # of a new field (s1), or of the scene's (s2)
    if isinstance(stage, StyleNetwork) and not stage.is_trained:
        return UNTRAINED
    return str(stage.task_family)


def seconds_scaled(seconds: float, start_s: float, work: float) -> float:
    """Returns the seconds of a stage with so many times the work; its start takes the same time."""
    start = min(seconds, start_s)
    return start + work * (seconds - start)


def work_ratio(work: str, here: Mapping[str, float], there: Mapping[str, float]) -> float:
    """Returns the work of a stage over that of a comparable one, from their drivers."""
    ratio = 1.0
    for name, exponent in EXPONENTS.get(work, {}).items():
        if here.get(name) and there.get(name):
            ratio *= (here[name] / there[name]) ** exponent
    return ratio * here.get("part", 1.0) / there.get("part", 1.0)


def added_seconds(work: str, here: Mapping[str, float]) -> float:
    """Returns the seconds for drivers of which the reference has none, on its machine."""
    return sum(s * here.get(name, 0.0) for name, s in ADDED_S.get(work, {}).items())


def is_comparable(work: str, here: Mapping[str, float], there: Mapping[str, float]) -> bool:
    """Returns whether two stages with the same work also do its parts, such as decode a video."""
    return all(_kind(here.get(name)) == _kind(there.get(name)) for name in ADDED_S.get(work, {}))


def _kind(driver: float | None) -> bool | None:
    """Returns whether there is such work; None where that is unknown."""
    return None if driver is None else driver > 0
