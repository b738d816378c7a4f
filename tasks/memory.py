"""The memory that the stages of a command will take, predicted before any of them begins.

A stage takes what its libraries take, and what grows: with the pixels of a frame, of a prior, or of
all photographs together, and with the points of the field's grid. The coefficients are measured:
`benchmarks/history.md` has predictions beside measurements. A grid that is not decided yet counts
as large as it may become. Of stages that compute on a GPU only those count whose frames are not
there.
"""

import json
import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import cast

import luigi

from pipeline.execution.gpu import visible_cards
from pipeline.settings import data_root, setting
from pipeline.task import artifact
from styletrf.errors import InputError
from tasks.build_order import is_made
from tasks.field import TrajectoryFrames
from tasks.scene import SceneCapture, SceneModel
from tasks.stage import TunedStage

MARGIN = 1.5
"""A command is refused where a stage would take more than so many times what is available."""
_LONGEST_PX = 1600  # of the undistorted photographs
_VIDEO_FRAMES = 60


@dataclass(frozen=True, slots=True)
class Growth:
    """What a stage takes: MiB for its libraries, and bytes for what there is more or less of.

    That are each pixel of a frame, of a prior, and of all photographs, and each point of the grid.
    """

    libraries_mib: int = 450
    frame: float = 0.0
    prior: float = 0.0
    photographs: float = 0.0
    grid: float = 0.0


GROWTH = {
    "RadianceField": Growth(700, photographs=6, grid=15),
    "TrajectoryFrames": Growth(650, frame=120),
    "StylizedPriors": Growth(450, prior=1300),
    "StylizedFrames": Growth(500, frame=95),
    "StylizedFrames per-frame": Growth(430, frame=320),
    "ConsistencyMetrics": Growth(450, frame=490),
    "StyleMetrics": Growth(580, frame=62),
}
"""By the name of the stage, with the method where that decides what it does."""


@dataclass(frozen=True, slots=True)
class Demand:
    """What decides the memory of a stage, as JSON can tell it to another interpreter.

    `photograph_px` is the longer side of the photographs as the field sees them, `frame_px` that of
    the frames, 0 for the same. `limit_bytes` is what the user allows the stage, 0 for anything.
    """

    stage: str
    scene: str
    photograph_px: int
    frame_px: int
    grid_points: int
    video_frames: int
    limit_bytes: int


@dataclass(frozen=True, slots=True)
class Photographs:
    """How many a scene has, and the size of the first in pixels."""

    count: int
    width: int
    height: int

    def pixels(self, long_side_px: int) -> int:
        """Returns how many pixels one has whose longer side is so long."""
        return round(long_side_px**2 * min(self.width, self.height) / max(self.width, self.height))


def demands_of(stages: Iterable[luigi.Task]) -> list[Demand]:
    """Returns the demands of those stages whose memory grows with what the user gives."""
    grown = (s for s in stages if isinstance(s, TunedStage) and demand_name(s) in GROWTH)
    to_make = (s for s in grown if not is_made(s))
    return [demand_of(s) for s in to_make if GROWTH[demand_name(s)].frame or not _is_on_a_card(s)]


def predicted_bytes(demand: Demand, photographs: Photographs) -> dict[str, float]:
    """Returns the largest memory of a stage, by what it is for; the sum is that of the stage."""
    growth, seen_px = GROWTH[demand.stage], _seen_px(demand, photographs)
    seen = photographs.pixels(seen_px)
    return {
        "libraries": growth.libraries_mib << 20,
        "frames": growth.frame * photographs.pixels(demand.frame_px or seen_px),
        "photographs": growth.photographs * photographs.count * seen + growth.prior * seen,
        "grid": growth.grid * demand.grid_points,
    }


def require_memory(
    demands: Sequence[Demand], available_bytes: int, scenes: dict[str, Photographs]
) -> None:
    """Refuses what takes clearly more memory than there is, by the stage that takes the most.

    Args:
        demands: Of the stages.
        available_bytes: What a process may take now.
        scenes: The photographs of each scene; a scene without is not looked at.

    Raises:
        InputError: A stage would take more than `MARGIN` times what is available to it.
    """

    def overdraft(demand: Demand) -> float:
        """Returns what a stage takes, in units of what it may."""
        taken = sum(predicted_bytes(demand, scenes[demand.scene]).values())
        return taken / _allowed(demand, available_bytes)

    known = [demand for demand in demands if demand.scene in scenes]
    worst = max(known, key=overdraft, default=None)
    if worst is None or overdraft(worst) <= MARGIN:
        return
    parts = predicted_bytes(worst, scenes[worst.scene])
    cause, remedy = _cause(worst, scenes[worst.scene], parts)
    needed, allowed = sum(parts.values()) / 2**30, _allowed(worst, available_bytes) / 2**30
    raise InputError(
        f"{worst.stage} of scene {worst.scene}, {cause}",
        f"takes about {needed:.1f} GiB of memory, and {allowed:.1f} GiB are available",
        f"{remedy}, or free memory; --keep-going begins all the same",
    )


def photographs_of(scene: str, video_frames: int) -> Photographs | None:
    """Returns the photographs of a scene; None where they cannot be read, as its stage reports.

    All count as alike: as large as the first, or, where that is a panorama, cut into square views.
    """
    from styletrf.capture.panorama.panorama_views import DIRECTIONS
    from styletrf.capture.panorama.panoramas import find_panoramas
    from styletrf.capture.photographs import list_photographs, read_photograph
    from styletrf.capture.poses.pose_formats import find_given_poses
    from styletrf.capture.user_folders import find_scene, scene_folder, scene_videos
    from styletrf.files.video import video_frames as frames_in

    with suppress(InputError):
        found = find_scene(data_root(), scene)
        if videos := scene_videos(found):
            height, width, _ = next(frames_in(videos[0])).shape
            return Photographs(video_frames, width, height)
        given = find_given_poses(scene_folder(found))
        files = given.files if given else list_photographs(found)
        height, width, _ = read_photograph(files[0]).shape
        if not given and find_panoramas({files[0]: (width, height)}, "auto"):
            return Photographs(len(DIRECTIONS) * len(files), _LONGEST_PX, _LONGEST_PX)
        return Photographs(len(files), width, height)
    return None


def demand_of(stage: TunedStage) -> Demand:
    """Returns the demand of a stage that is named in `GROWTH`."""
    model = stage.need(SceneModel)
    limit_gib = stage.memory_gib or float(setting("store", "memory_gib"))
    return Demand(
        stage=demand_name(stage),
        scene=str(stage.param_kwargs["scene"]),
        photograph_px=model.values()["image_long_side"],
        frame_px=stage.need(TrajectoryFrames).values().get("long_side_px", 0),
        grid_points=_grid_points(model),
        video_frames=stage.need(SceneCapture).values().get("video_frames", _VIDEO_FRAMES),
        limit_bytes=int(limit_gib * 2**30),
    )


def _grid_points(model: SceneModel) -> int:
    """Returns how many points the finest grid has, or may have while that is not decided."""
    if is_made(model):
        with suppress(OSError):  # it may be in the shared store alone
            decided = json.loads((artifact(model) / "scene.json").read_text())
            return math.prod(decided["resolution"])
    return cast("int", model.values()["max_voxels"])


def demand_name(stage: TunedStage) -> str:
    """Returns the family, and the method where that decides what a stage does."""
    is_stylized = stage.task_family == "StylizedFrames"
    is_painted = is_stylized and stage.param_kwargs.get("method") == "per-frame"
    return f"{stage.task_family}{' per-frame' if is_painted else ''}"


def _is_on_a_card(stage: TunedStage) -> bool:
    return stage.needs_gpu and bool(visible_cards())


def _seen_px(demand: Demand, photographs: Photographs) -> int:
    return min(demand.photograph_px, _LONGEST_PX, max(photographs.width, photographs.height))


def _allowed(demand: Demand, available_bytes: int) -> int:
    return max(1, min(available_bytes, demand.limit_bytes or available_bytes))


def _cause(demand: Demand, photographs: Photographs, parts: dict[str, float]) -> tuple[str, str]:
    """Returns what takes most of a stage's memory beside the libraries, and what to do about it."""
    seen = _seen_px(demand, photographs)
    size = f"{demand.frame_px or seen} pixels long"
    told = {
        "frames": (f"with frames {size}", "Give a smaller --frame-size"),
        "photographs": (
            f"with {photographs.count} photographs {seen} pixels long",
            "Give --quality draft or fewer photographs",
        ),
        "grid": (
            f"with a grid of up to {demand.grid_points:,} points",
            "Give --quality draft, or a smaller max_voxels in --SceneModel-settings",
        ),
    }
    return told[max(told, key=lambda name: parts[name])]
