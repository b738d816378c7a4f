"""Validation of a command before anything long begins.

The names and types of settings, and the presence of a GPU, are checked by libraries that Luigi's
process does not load. So another process checks them.
"""

import dataclasses
import json
import shutil
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import luigi

from pipeline.execution.cpu_memory import available_memory_bytes
from pipeline.execution.fork_server import answer_of
from pipeline.settings import current_store, data_root
from styletrf.errors import InputError
from tasks.command.graph import graph
from tasks.command.sources import may_stop, sources_of
from tasks.planning.disk_demand import require_disk
from tasks.planning.memory_demand import Demand, demands_of, photographs_of, require_memory
from tasks.stages.field import TrajectoryFrames
from tasks.stages.scene import SceneCapture
from tasks.stages.stage import ConfigurableStage, Stage

LEAST_ROOM_BYTES = 64 << 20  # free disk space that a command needs to begin


def validate_command(root: luigi.Task) -> Sequence[luigi.Task]:
    """Returns the stages of a command; ends a command that is bound to fail, with one line.

    Args:
        root: The task of the command.

    Raises:
        InputError: A budget or a combination of parameters is invalid.
        SystemExit: A setting, the device or a video is invalid, or they could not be checked.
    """
    stages = graph(root)
    sources_of(root)  # once, before workers are forked
    for stage in stages:
        if hasattr(stage, "validate"):  # Luigi's own tasks do not
            stage.validate()
        if hasattr(stage, "require_reachable"):
            stage.require_reachable()
    require_room(current_store().root)
    demands = demands_of(stages) if may_stop(root) else []
    tuned = [s for s in stages if isinstance(s, ConfigurableStage) and (s.settings or s.tuning)]
    settings = {(stage.task_family, json.dumps(stage.values())) for stage in tuned}
    request = {
        "tuned": sorted({name for stage in tuned for name in stage.tuning}),
        "cuda": any(isinstance(stage, Stage) and stage.device == "cuda" for stage in stages),
        "settings": sorted(settings),
        "paths": sorted({path for stage in stages if (path := _path_of(stage))}),
        "memory": [dataclasses.asdict(demand) for demand in demands],
        "free_bytes": shutil.disk_usage(current_store().root).free if demands else 0,
    }
    if any(request.values()) and (error := _validation_error(request)):
        raise SystemExit(error)
    return stages


def require_room(root: Path) -> None:
    """Rejects a disk that is too full for even the first stages.

    Raises:
        InputError: Less than LEAST_ROOM_BYTES are free.
    """
    free = shutil.disk_usage(root).free
    if free < LEAST_ROOM_BYTES:
        raise InputError(
            f"the disk of {root}",
            f"has {free >> 20} MiB free; a scene in one style takes about 300",
            "Free some space (python -m pipeline gc), or set STYLETRF_STORE to another disk",
        )


def configurations() -> dict[str, type]:
    """Returns the configuration class of each configurable stage, by family."""
    from styletrf.capture.scene_capture import CaptureConfig
    from styletrf.content.content_images import ContentConfig
    from styletrf.evaluation.consistency.trajectory_consistency import ConsistencyConfig
    from styletrf.evaluation.quality import QualityConfig
    from styletrf.evaluation.resemblance.frame_resemblance import ResemblanceConfig
    from styletrf.evaluation.stylization_loss import StylizationLossConfig
    from styletrf.field.rendering import RenderConfig
    from styletrf.field.training.config import FieldTrainingConfig
    from styletrf.scene.scene_model import SceneModelConfig
    from styletrf.sfm.camera_poses import CameraPosesConfig
    from styletrf.style.gatys import GatysConfig
    from styletrf.style.training.config import StyleTrainingConfig
    from styletrf.stylization.priors import PriorsConfig
    from styletrf.stylization.strategies import StylizationConfig
    from styletrf.trajectory.frames import FramesConfig

    return {
        "CameraPoses": CameraPosesConfig,
        "ConsistencyMetrics": ConsistencyConfig,
        "ContentImages": ContentConfig,
        "PriorRenders": PriorsConfig,
        "QualityMetrics": QualityConfig,
        "RadianceField": FieldTrainingConfig,
        "SceneCapture": CaptureConfig,
        "SceneModel": SceneModelConfig,
        "StyleMetrics": ResemblanceConfig,
        "StyleNetwork": StyleTrainingConfig,
        "StylizationMetrics": StylizationLossConfig,
        "StylizedField": StylizationConfig,
        "StylizedPriors": GatysConfig,
        "StylizedFrames": RenderConfig,
        "TrajectoryFrames": FramesConfig,
    }


def _path_of(stage: luigi.Task) -> tuple[str, str, str] | None:
    """Returns the file of the camera path, the scene and the settings of its capture, as JSON.

    None, if the stage has no such file.
    """
    if isinstance(stage, TrajectoryFrames) and stage.path_file() is not None:
        capture = stage.upstream(SceneCapture).values()
        return str(stage.path), str(stage.scene), json.dumps(capture)
    return None


def _require_path(file: str, scene: str, capture: Mapping[str, Any]) -> None:
    """Rejects a file that is not a path, or whose cameras cannot be placed in the scene."""
    from styletrf.capture.expected_names import expected_names
    from styletrf.capture.scene_capture import CaptureConfig
    from styletrf.capture.user_folders import find_scene
    from styletrf.configuration import configured
    from styletrf.trajectory.path_files import (
        names_asked,
        read_path,
        require_common_world,
        require_photographs,
    )

    keys, config = read_path(Path(file)), configured(CaptureConfig, capture)
    try:
        expected = expected_names(find_scene(data_root(), scene), config, names_asked(keys))
    except InputError:  # which the scene's own stage reports
        return
    require_common_world(keys, are_given=expected.poses_are_given)
    if expected.names is not None:
        require_photographs(keys, expected.names)


def _require_videos(scene: str) -> None:
    """Rejects a video of which no frame can be decoded."""
    from styletrf.capture.user_folders import find_scene, scene_videos
    from styletrf.files.video import first_frame

    videos = list[Path]()
    with suppress(InputError):  # which the scene's own stage reports
        videos = scene_videos(find_scene(data_root(), scene))
    for video in videos:
        first_frame(video)


def _validation_error(request: dict[str, Any]) -> str:
    """Returns the error that another process finds, or that it failed; "" if there is none."""
    try:
        return answer_of("tasks.planning.validation:main", json.dumps(request)).strip()
    except RuntimeError as error:
        return f"The command could not be checked: {error}. What it wrote above may say why."


def _check(request: dict[str, Any]) -> None:
    from styletrf.configuration import configured
    from styletrf.devices import device_named

    if request["cuda"]:
        device_named("cuda")
    if request["tuned"] and (unknown := set(request["tuned"]) - set(configurations())):
        remedy = f"Give some of {sorted(configurations())}"
        raise InputError(f"--tuning {sorted(unknown)}", "are not stages with settings", remedy)
    for family, values in request["settings"]:
        try:
            configured(configurations()[family], json.loads(values))
        except InputError as error:
            subject = f"settings of {family}, {error.subject}"
            raise InputError(subject, error.problem, error.remedy) from error
    for file, scene, capture in request["paths"]:
        _require_path(file, scene, json.loads(capture))
    demands = [Demand(**demand) for demand in request["memory"]]
    for scene in {demand.scene for demand in demands}:
        _require_videos(scene)
    scenes = {demand.scene: photographs_of(demand.scene, demand.video_frames) for demand in demands}
    known = {scene: found for scene, found in scenes.items() if found}
    require_memory(demands, available_memory_bytes(), known)
    require_disk(demands, request["free_bytes"], known)


def main() -> int:
    """Checks what standard input asks for, and writes what is wrong; returns the exit status."""
    try:
        _check(json.load(sys.stdin))
    except InputError as error:
        sys.stdout.write(str(error))
    return 0
