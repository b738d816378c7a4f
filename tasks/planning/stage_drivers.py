"""The drivers of the work of a stage: its settings, those upstream that count, and sizes."""

from collections.abc import Iterator, Mapping
from typing import Any

import luigi

from tasks.planning.disk_demand import BYTES_A_PIXEL
from tasks.planning.memory_demand import Photographs
from tasks.planning.stage_demands import demand_name
from tasks.planning.stage_work import (
    COVERAGE_EXPONENT,
    OPTIMIZATION_ITERATIONS,
    PRIOR_PIXELS,
    PRIORS,
    WHOLE_FIT,
    work_of,
)
from tasks.presets.sweep import CONFIG_DEFAULTS
from tasks.stages.field import PriorRenders, RadianceField, TrajectoryFrames
from tasks.stages.path_parameters import PathParameters, frame_count
from tasks.stages.scene import SceneModel
from tasks.stages.shards import ShardedStage
from tasks.stages.stage import ConfigurableStage, PresetStage
from tasks.stages.stylization import StylizedField, StylizedPriors

LONGEST_DESCRIBED = 1600
"""The default of `max_image_long_side` of `CameraPoses`, in pixels."""
MOST_FEATURES = {"max_features": 4096, "video_features": 1536}
"""The defaults of these settings of `CameraPoses`."""
_OWN = {"iterations", "batch"}  # settings that say nothing of stages further downstream
_OF_PRIORS = {"PriorRenders", "StylizedField", "StylizedPriors"}
_JOINING = 0.1  # of the work of all parts, to put them together


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
    settings = _settings(stage, upstream) if isinstance(stage, PresetStage) else {}
    numbers = {name: number for name, value in settings.items() for number in _number(value)}
    path_seconds = stage.path_seconds if isinstance(stage, PathParameters) else 0.0
    numbers["frames"] = frame_count(settings, path_seconds) or 0
    if isinstance(stage, ConfigurableStage):
        numbers["bytes_a_pixel"] = BYTES_A_PIXEL.get(demand_name(stage), 0.0)
    joins = isinstance(stage, ShardedStage) and stage.shards > 1 and not stage.shard
    if joins:
        numbers["part"] = _JOINING
    elif isinstance(stage, ShardedStage) and stage.shard:
        numbers["part"] = 1 / int(stage.shard.partition("/")[2])
    photographs = sizes.get(str(stage.param_kwargs.get("scene", "")))
    if photographs:
        numbers |= _pixels(photographs, settings, of_prior=stage.task_family in _OF_PRIORS)
    if isinstance(stage, StylizedField) and work_of(stage) == WHOLE_FIT:
        numbers |= _whole_fit(stage.strategy, numbers)
    if isinstance(stage, StylizedPriors):
        optimizes = stage.stylizer == "gatys" and not joins  # its shards are optimized already
        numbers |= _optimization(numbers) if optimizes else {"optimized_pixels": 0}
    return numbers


def _settings(stage: PresetStage, upstream: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the settings of a stage, and those of the stages upstream that count for it."""
    settings: dict[str, Any] = {}
    for each in _deciding(stage, upstream):
        settings = {name: value for name, value in settings.items() if name not in _OWN}
        settings |= CONFIG_DEFAULTS.get(each.task_family, {}) | each.values()
    return settings


def _whole_fit(strategy: str, numbers: Mapping[str, float]) -> dict[str, float]:
    """Returns the drivers of the fit of a new field (s1), or of the fit by which s2 goes on.

    The latter has the size of the scene's field, and as many rays as an adaptation.
    """
    fit = {name.removeprefix("fit."): n for name, n in numbers.items() if name.startswith("fit.")}
    if strategy == "s1" or not fit.get("batch"):
        return fit
    rays = numbers.get("adaptation.iterations", 0.0) * numbers.get("adaptation.batch", 0.0)
    return {"batch": fit["batch"], "iterations": rays / fit["batch"]}


def _optimization(numbers: Mapping[str, float]) -> dict[str, float]:
    """Returns the iterations for each prior, and the pixels of all priors times these."""
    iterations = numbers.get("iterations", OPTIMIZATION_ITERATIONS)
    usual = float(CONFIG_DEFAULTS["PriorRenders"]["coverage.times"])
    covered = max(0.0, numbers.get("coverage.times", usual)) / usual
    priors = numbers.get("coverage.count") or PRIORS * covered**COVERAGE_EXPONENT
    pixels = numbers.get("part", 1.0) * numbers.get("frame_pixels", PRIOR_PIXELS)
    return {"iterations": iterations, "optimized_pixels": iterations * priors * pixels}


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
    if of_prior or not settings.get("enlarged", True):  # no larger than the photographs
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
