"""Float renders of a field along a path, in shards or at once."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from styletrf.devices import device_named
from styletrf.field.radiance_field import load_field
from styletrf.field.rendering import RenderConfig
from styletrf.geometry.camera_table import read_cameras
from styletrf.geometry.cameras import Camera
from styletrf.scene.scene_model import SceneModel, read_scene_model
from styletrf.steps.sharding import shard_folders, shard_of
from styletrf.steps.step_run import StepRun
from styletrf.trajectory.frames import (
    float_frames,
    join_float_frames,
    rendered,
    write_clip,
    write_float_frames,
)


@runtime_checkable
class RenderSettings(Protocol):
    """The settings that renders along any path have."""

    @property
    def long_side_px(self) -> int:
        """The longer side of the frames, 0 for the scene's."""

    @property
    def render(self) -> RenderConfig:
        """The settings of rendering."""

    @property
    def frames_per_second(self) -> int:
        """The rate of the video."""


@dataclass(frozen=True, slots=True)
class PathSource:
    """The inputs of the choice of a path.

    Attributes:
        inputs: The folders of the step.
        photographed: The photographs' cameras in the normalized world, at the size of the renders.
        model: The model of the scene.
        device_name: `auto`, `cpu` or `cuda`.
    """

    inputs: Mapping[str, Path]
    photographed: list[Camera]
    model: SceneModel
    device_name: str


def render_path(
    inputs: Mapping[str, Path],
    out: Path,
    config: RenderSettings,
    run: StepRun,
    choose: Callable[[PathSource], list[Camera]],
) -> None:
    """Writes `frames/NAME.exr` (R G B A half, Z float), `cameras.parquet` and `video.mp4`.

    A shard leaves its frames and all cameras, and no video.

    Args:
        inputs: `field`, `poses`, `model`; or the shards to join.
        out: The folder to fill.
        config: The settings of the path and of the renders.
        run: Its progress is the number of frames.
        choose: Returns the cameras of the whole path.
    """
    if shards := shard_folders(inputs):
        join_float_frames(shards, out)
    else:
        model = read_scene_model(inputs["model"] / "scene.json")
        posed = read_cameras(inputs["poses"] / "cameras.parquet")
        photographed = model.normalized(posed, config.long_side_px)
        path = choose(PathSource(inputs, photographed, model, run.device_name))
        cameras = shard_of(path, run.shard)
        field, device = load_field(inputs["field"]), device_named(run.device_name)
        renders = rendered(field, model.space, cameras, config.render, device, run.progress)
        write_float_frames(out, cameras, renders, path)
    if not run.shard:
        write_clip(out / "video.mp4", float_frames(out), config.frames_per_second)
