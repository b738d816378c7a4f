"""The demands of the stages of a command: the inputs that decide how much memory each takes.

A grid of unknown size counts as the largest allowed. Of the stages on a GPU only those that keep
frames in main memory count. `tasks.planning.memory_demand` predicts the bytes.
"""

import json
import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any, cast

import luigi

from pipeline.execution.gpu import visible_gpus
from pipeline.settings import number_setting
from pipeline.task import artifact
from tasks.command.found_records import is_made
from tasks.planning.artifact_names import ArtifactNames
from tasks.planning.memory_demand import GROWTH, Demand
from tasks.stages.field import PriorRenders, TrajectoryFrames
from tasks.stages.path_parameters import frame_count
from tasks.stages.scene import SceneCapture, SceneModel
from tasks.stages.stage import ConfigurableStage

_VIDEO_FRAMES = 60
_ADAPTATION = {"iterations": 400, "batch": 16384, "min_weight": 1e-2, "cache_bytes": 3 << 30}
"""The defaults of the settings that decide which rays an adaptation to pixels keeps."""
_RAY_BYTES, _SAMPLE_BYTES = 40, 16
_KEPT_SAMPLES = 0.1  # of the most that a ray could keep: 1 / min_weight, as its weights sum to 1


def demands_of(stages: Iterable[luigi.Task]) -> list[Demand]:
    """Returns the demands of the stages whose memory grows with the user's input.

    Stages that will have the same artifact, such as variants of a sweep, count once.
    """
    grown = (s for s in stages if isinstance(s, ConfigurableStage) and demand_name(s) in GROWTH)
    names = ArtifactNames()
    each_once = {names.of(s): s for s in grown}.values()
    to_make = [s for s in each_once if not is_made(s)]
    has_gpu = any(s.needs_gpu for s in to_make) and bool(visible_gpus())
    large = (s for s in to_make if GROWTH[demand_name(s)].frame or not (has_gpu and s.needs_gpu))
    return [demand_of(s) for s in large]


def demand_of(stage: ConfigurableStage) -> Demand:
    """Returns the demand of a stage listed in `GROWTH`."""
    model, priors = stage.upstream(SceneModel), stage.upstream(PriorRenders)
    rays, ray_bytes = _kept_rays(stage.values())
    trajectory = stage.upstream(TrajectoryFrames)
    path = trajectory.values()
    limit_gib = stage.memory_gib or number_setting("store", "memory_gib")
    return Demand(
        stage=demand_name(stage),
        scene=str(stage.param_kwargs["scene"]),
        photograph_px=model.values()["image_long_side"],
        frame_px=path.get("long_side_px", 0),
        prior_px=priors.values().get("long_side_px", 0),
        grid_points=_grid_points(model),
        video_frames=stage.upstream(SceneCapture).values().get("video_frames", _VIDEO_FRAMES),
        limit_bytes=int(limit_gib * 2**30),
        frames=math.ceil((frame_count(path, trajectory.path_seconds) or 0) / _shards_of(stage)),
        priors=_prior_views(priors) if rays else 0,
        rays=rays,
        ray_bytes=ray_bytes,
    )


def _shards_of(stage: ConfigurableStage) -> int:
    """Returns the number of shards of which the stage builds one; 1 for a whole."""
    shard = str(stage.param_kwargs.get("shard", ""))
    return int(shard.partition("/")[2]) if shard else 1


def _kept_rays(settings: Mapping[str, Any]) -> tuple[int, float]:
    """Returns the most rays that an adaptation to pixels keeps, and the bytes of one.

    Both are 0 if a surface point has one ray.
    """
    numbers = [settings.get(f"adaptation.{name}", usual) for name, usual in _ADAPTATION.items()]
    are_valid = all(isinstance(n, int | float) and 0 < n < math.inf for n in numbers)
    if settings.get("single_owner", True) or not are_valid:
        return 0, 0.0  # invalid numbers are rejected with the settings
    iterations, batch, min_weight, cache_bytes = numbers
    ray_bytes = _RAY_BYTES + _SAMPLE_BYTES * _KEPT_SAMPLES / min_weight
    return int(min(iterations * batch, cache_bytes / ray_bytes)), ray_bytes


def _prior_views(priors: PriorRenders) -> int:
    """Returns the number of priors; 0 while it is not decided."""
    if is_made(priors):
        with suppress(OSError):  # they may be in the shared store alone
            return len(list((artifact(priors) / "frames").iterdir()))
    return 0


def _grid_points(model: SceneModel) -> int:
    """Returns the points of the finest grid; the largest allowed while that is not decided."""
    if is_made(model):
        with suppress(OSError):  # it may be in the shared store alone
            decided = json.loads((artifact(model) / "scene.json").read_text())
            return math.prod(decided["resolution"])
    return cast("int", model.values()["max_voxels"])


def demand_name(stage: ConfigurableStage) -> str:
    """Returns the family, with the method, loss or strategy that decides what it computes."""
    parameters = stage.param_kwargs
    if stage.task_family == "StylizedFrames" and parameters.get("method") == "per-frame":
        return "StylizedFrames per-frame"
    if getattr(stage, "has_own_depths", False):
        return "StylizedFrames own depths"
    if stage.task_family == "StylizedField" and parameters["strategy"] != "s3":
        return f"StylizedField {parameters['strategy']}"
    if getattr(stage, "resolved_match", "") == "pixels":
        return "StylizedField pixels"
    return str(stage.task_family)
