"""Checks the parameters of a command by the libraries that its stages use.

Luigi's process does not load these libraries, so another process runs `main`.
"""

import json
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from pipeline.execution.cpu_memory import available_memory_bytes
from pipeline.settings import data_root
from styletrf.capture.expected_names import expected_names
from styletrf.capture.scene_capture import CaptureConfig
from styletrf.capture.user_folders import find_scene, scene_videos
from styletrf.configuration import configured
from styletrf.content.content_images import ContentConfig
from styletrf.devices import device_named
from styletrf.errors import InputError
from styletrf.evaluation.consistency.trajectory_consistency import ConsistencyConfig
from styletrf.evaluation.quality import QualityConfig
from styletrf.evaluation.resemblance.frame_resemblance import ResemblanceConfig
from styletrf.evaluation.stylization_loss import StylizationLossConfig
from styletrf.field.rendering import RenderConfig
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.files.video_frames import first_frame
from styletrf.scene.scene_model import SceneModelConfig
from styletrf.sfm.camera_poses import CameraPosesConfig
from styletrf.style.gatys import GatysConfig
from styletrf.style.training.config import StyleTrainingConfig
from styletrf.stylization.priors import PriorsConfig
from styletrf.stylization.strategies import StylizationConfig
from styletrf.trajectory.frames import FramesConfig
from styletrf.trajectory.path_files import (
    names_asked,
    read_path,
    require_common_world,
    require_photographs,
)
from tasks.planning.disk_demand import require_disk
from tasks.planning.memory_demand import Demand, require_memory
from tasks.planning.scene_photographs import photographs_of


def configurations() -> dict[str, type]:
    """Returns the configuration class of each configurable stage, by family."""
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


def main() -> int:
    """Checks the request on standard input, and writes its errors; returns the exit status."""
    try:
        _check(json.load(sys.stdin))
    except InputError as error:
        sys.stdout.write(str(error))
    return 0


def _check(request: dict[str, Any]) -> None:
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
    frames = {demand.scene: demand.video_frames for demand in demands}
    for scene in frames:
        _require_videos(scene)
    scenes = {scene: photographs_of(scene, count) for scene, count in frames.items()}
    known = {scene: found for scene, found in scenes.items() if found}
    require_memory(demands, available_memory_bytes(), known)
    require_disk(demands, request["free_bytes"], known)


def _require_path(file: str, scene: str, capture: Mapping[str, Any]) -> None:
    """Rejects a file that is not a path, or whose cameras cannot be placed in the scene."""
    keys, config = read_path(Path(file)), configured(CaptureConfig, capture)
    try:
        expected = expected_names(find_scene(data_root(), scene), config, names_asked(keys))
    except InputError:  # which the scene's own stage reports
        return
    require_common_world(keys, are_given=expected.poses_are_given)
    require_photographs(keys, expected.names)


def _require_videos(scene: str) -> None:
    """Rejects a video of which no frame can be decoded."""
    videos = list[Path]()
    with suppress(InputError):  # which the scene's own stage reports
        videos = scene_videos(find_scene(data_root(), scene))
    for video in videos:
        first_frame(video)
