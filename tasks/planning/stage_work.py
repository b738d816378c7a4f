"""Predicts how much longer a stage takes with other settings, or for another scene.

A stage is taken to need a constant time to start, and beyond it seconds in proportion to

    product over its drivers of value ** exponent,

where a driver is a setting or a size. The exponents are rounded from sweeps of single settings
(`benchmarks/README.md`, "Time against accuracy"), and are 1 where a stage does the same for every
photograph, frame or pixel. That of the pixels of features is from three captures of 20 to 62
photographs, and that of features, of which frames of videos have fewer, from clips of a minute.
Other settings are taken to leave the time as it is.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import luigi

from tasks.planning.memory_demand import Photographs
from tasks.presets.sweep import CONFIG_DEFAULTS
from tasks.stages.field import PriorRenders, RadianceField, TrajectoryFrames
from tasks.stages.path_parameters import frame_count
from tasks.stages.scene import SceneModel
from tasks.stages.shards import ShardedStage
from tasks.stages.stage import ConfigurableStage, PresetStage

START_S = 1.5
"""Seconds of a stage in which its interpreter starts and its libraries load, where measured."""
LONGEST_DESCRIBED = 1600
"""The default of `max_image_long_side` of `CameraPoses`, in pixels."""
MOST_FEATURES = {"max_features": 4096, "video_features": 1536}
"""The defaults of these settings of `CameraPoses`."""
_OF_PRIORS = {"PriorRenders", "StylizedField", "StylizedPriors"}
_JOINING = 0.1  # of the work of all parts, to put them together

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
    "PriorRenders": {"coverage.times": 0.3, "frame_pixels": 1, "field.appearance_ranks": 1 / 3},
    "StyleNetwork": {"iterations": 0.9, "batch": 0.9, "crop_px": 1.3},
    "StylizedPriors": {"coverage.times": 0.3, "frame_pixels": 1},
    "StylizedField": {
        "adaptation.iterations": 0.1, "image.iterations": 0.7, "coverage.times": 0.2,
        "frame_pixels": 0.7, "field.appearance_ranks": 1 / 3,
    },
    "StylizedFrames": {"frames": 1, "frame_pixels": 1, "field.appearance_ranks": 1 / 3},
    "ConsistencyMetrics": {"pairs": 1, "frame_pixels": 1},
    "StyleMetrics": {"frame_pixels": 1},
}  # fmt: skip
"""The exponents by stage and driver; `field.appearance_ranks` are the sum of the list."""

ADDED_S: dict[str, dict[str, float]] = {"SceneCapture": {"filmed_pixels": 1.2e-8}}
"""Seconds for a unit of a driver of which the reference has none, on its machine.

Two cores decode a minute of 1920x1080 at 30 frames a second, and follow its motion, in 46 s.
"""


def seconds_scaled(seconds: float, start_s: float, work: float) -> float:
    """Returns the seconds of a stage with so many times the work; its start takes the same time."""
    start = min(seconds, start_s)
    return start + work * (seconds - start)


def work_ratio(family: str, here: Mapping[str, float], there: Mapping[str, float]) -> float:
    """Returns the work of a stage over that of another of its family, from their drivers."""
    ratio = 1.0
    for name, exponent in EXPONENTS.get(family, {}).items():
        if here.get(name) and there.get(name):
            ratio *= (here[name] / there[name]) ** exponent
    return ratio * here.get("part", 1.0) / there.get("part", 1.0)


def added_seconds(family: str, here: Mapping[str, float]) -> float:
    """Returns the seconds for drivers of which the reference has none, on its machine."""
    return sum(s * here.get(name, 0.0) for name, s in ADDED_S.get(family, {}).items())


def is_comparable(family: str, here: Mapping[str, float], there: Mapping[str, float]) -> bool:
    """Returns whether two stages of a family do the same kinds of work, such as decode a video."""
    return all(_kind(here.get(name)) == _kind(there.get(name)) for name in ADDED_S.get(family, {}))


def _kind(driver: float | None) -> bool | None:
    """Returns whether there is such work; None where that is unknown."""
    return None if driver is None else driver > 0


def drivers_of(
    stage: luigi.Task, sizes: Mapping[str, Photographs], **upstream: Any
) -> dict[str, float]:
    """Returns the values of the drivers of a stage: its settings, and the sizes of its scene.

    Args:
        stage: The stage whose drivers are returned.
        sizes: The photographs of scenes, by name.
        upstream: Parameters of the stages upstream, where they are not those of this command:
            `settings={}`, since a command's settings of a family are otherwise its default.
    """
    settings: dict[str, Any] = {}
    if isinstance(stage, PresetStage):
        for each in _deciding(stage, upstream):
            settings |= CONFIG_DEFAULTS.get(each.task_family, {}) | each.values()
    numbers = {name: number for name, value in settings.items() for number in _number(value)}
    numbers["frames"] = frame_count(settings) or 0
    if isinstance(stage, ShardedStage) and (stage.shard or stage.shards > 1):
        numbers["part"] = 1 / int(stage.shard.partition("/")[2]) if stage.shard else _JOINING
    photographs = sizes.get(str(stage.param_kwargs.get("scene", "")))
    if photographs:
        numbers |= _pixels(photographs, settings, of_prior=stage.task_family in _OF_PRIORS)
    return numbers


def _deciding(stage: PresetStage, upstream: Mapping[str, Any]) -> Iterator[ConfigurableStage]:
    """Yields the stages whose settings decide the work of this one, itself last."""
    renders = PriorRenders if stage.task_family in _OF_PRIORS else TrajectoryFrames
    if "scene" in stage.param_kwargs:
        for kind in (SceneModel, RadianceField, renders):
            if type(stage) is not kind:
                yield stage.upstream(kind, **upstream)
    if isinstance(stage, ConfigurableStage):
        yield stage


def _pixels(
    photographs: Photographs, settings: Mapping[str, Any], *, of_prior: bool
) -> dict[str, float]:
    longest = max(photographs.width, photographs.height)
    seen = min(int(settings.get("image_long_side", longest)), longest)
    described = min(int(settings.get("max_image_long_side", LONGEST_DESCRIBED)), longest)
    frame = int(settings.get("long_side_px", 0)) or seen
    if of_prior:  # priors are no larger than the photographs; frames of the path may be
        frame = min(frame, longest)
    features = "video_features" if photographs.filmed_pixels else "max_features"
    return {
        "features": int(settings.get(features, MOST_FEATURES[features])),
        "photographs": photographs.count,
        "copied_photographs": 0 if photographs.filmed_pixels else photographs.count,
        "filmed_pixels": photographs.filmed_pixels,
        "photograph_pixels": photographs.pixels(seen),
        "feature_pixels": photographs.pixels(described),
        "frame_pixels": photographs.pixels(frame),
    }


def _number(value: Any) -> Iterator[float]:
    if isinstance(value, list | tuple) and all(isinstance(part, int | float) for part in value):
        yield float(sum(value))
    elif isinstance(value, int | float):
        yield float(value)
