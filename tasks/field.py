"""The radiance field and its renders."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import luigi

from pipeline.task import RunContext
from tasks.path_controls import PathControls
from tasks.scene import CameraPoses, SceneModel
from tasks.shards import ShardedStage, parts_in
from tasks.stage import Stage, TunedStage


class RadianceField(TunedStage):
    """A TensoRF fitted to all photographs but every eighth.

    Leaves `density.safetensors`, `appearance.safetensors`, `field.json` and `curve.parquet`. A
    killed run goes on from its last checkpoint.
    """

    scene = luigi.Parameter(description="a folder in data/scenes")
    tools = ("numba", "opencv-contrib-python-headless", "torch")
    computes = True

    def requires(self) -> Mapping[str, Stage]:
        """The images with their cameras, and the model."""
        return {"poses": self.need(CameraPoses), "model": self.need(SceneModel)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Fit the field."""
        import torch

        from styletrf.capture.views import load_views
        from styletrf.configuration import configured
        from styletrf.devices import device_named
        from styletrf.field.kernels import kernels_for
        from styletrf.field.radiance_field import save_field
        from styletrf.field.training.config import FieldTrainingConfig
        from styletrf.field.training.sparse_depth import sparse_depths
        from styletrf.field.training.trainer import train_field
        from styletrf.field.training.view_exposures import view_exposures
        from styletrf.files.tables import write_curve
        from styletrf.scene.free_space import free_space
        from styletrf.scene.scene_model import read_scene_model
        from styletrf.scene.training_photographs import read_training_photographs

        device = device_named(self.device)
        model = read_scene_model(inputs["model"] / "scene.json")
        photographs = read_training_photographs(inputs["poses"])
        fitted, points = photographs.cameras, photographs.points
        cameras = model.normalized(fitted)
        field, curve = train_field(
            cameras,
            load_views(photographs.folder, cameras, device),
            model.space,
            model.resolution,
            configured(FieldTrainingConfig, {"field.shading": model.shading, **self.values()}),
            kernels_for(device),
            run.progress,
            run.resume,
            torch.from_numpy(free_space(model, fitted, points)),
            sparse_depths(model, fitted, points),
            view_exposures(fitted, model.exposures, device),
        )
        save_field(out, field)
        write_curve(out / "curve.parquet", curve)


@dataclass(frozen=True, slots=True)
class PathSource:
    """What a path is chosen from.

    Attributes:
        inputs: The artifacts of the stage.
        photographed: The photographs' cameras in the normalised world, at the size of the renders.
        model: Of the scene.
        config: Of path and renders.
    """

    inputs: Mapping[str, Path]
    photographed: list[Any]
    model: Any
    config: Any


class PathRenders(ShardedStage, PathControls):
    """Float renders of the field along a path.

    Leaves `frames/NAME.exr` (R G B A half, Z float), `cameras.parquet` and `video.mp4`; a part
    leaves its frames and all the cameras.
    """

    scene = luigi.Parameter(description="a folder in data/scenes")
    tools: ClassVar[tuple[str, ...]] = ("av", "numba", "torch")
    computes = True

    def requires(self) -> Mapping[str, Stage]:
        """The field, the cameras and the model that place the path, and the parts."""
        return {
            "field": self.need(RadianceField),
            "poses": self.need(CameraPoses),
            "model": self.need(SceneModel),
            **self.parts(),
        }

    @abstractmethod
    def config(self, values: Mapping[str, Any]) -> Any:
        """The configuration of path and renders from the settings."""

    @abstractmethod
    def cameras(self, given: PathSource, out: Path) -> list[Any]:
        """The cameras to render; may add to the artifact in `out`."""

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Render the path, or put its parts together."""
        from styletrf.trajectory.frames import float_frames, join_float_frames, write_clip

        config = self.config(self.values())
        if parts := parts_in(inputs):
            join_float_frames(parts, out)
        else:
            self._render(inputs, out, config, run)
        if not self.shard:
            write_clip(out / "video.mp4", float_frames(out), config.frames_per_second)

    def _render(self, inputs: Mapping[str, Path], out: Path, config: Any, run: RunContext) -> None:
        from styletrf.devices import device_named
        from styletrf.field.radiance_field import load_field
        from styletrf.geometry.camera_table import read_cameras
        from styletrf.scene.scene_model import read_scene_model
        from styletrf.trajectory.frames import rendered, write_float_frames

        model = read_scene_model(inputs["model"] / "scene.json")
        posed = read_cameras(inputs["poses"] / "cameras.parquet")
        photographed = model.normalized(posed, config.long_side_px)
        path = self.cameras(PathSource(inputs, photographed, model, config), out)
        cameras = self.of_part(path)
        renders = rendered(
            load_field(inputs["field"]),
            model.space,
            cameras,
            config.render,
            device_named(self.device),
            run.progress,
        )
        write_float_frames(out, cameras, renders, path)


class PriorRenders(PathRenders):
    """The few views that the style network will paint: they show all that the path sees."""

    def requires(self) -> Mapping[str, Stage]:
        """The field, what places the candidates, and what the path sees."""
        return {**super().requires(), "trajectory": self.need(TrajectoryFrames)}

    def config(self, values: Mapping[str, Any]) -> Any:
        """Candidates, choice and renders."""
        from styletrf.configuration import configured
        from styletrf.stylization.priors import PriorsConfig

        return configured(PriorsConfig, values)

    def cameras(self, given: PathSource, out: Path) -> list[Any]:
        """The viewpoints, of those that fill what the fly-through goes around, that are needed."""
        from styletrf.devices import device_named
        from styletrf.field.radiance_field import load_field
        from styletrf.stylization.priors import needed_views
        from styletrf.trajectory.trajectories import prior_views

        candidates = prior_views(given.photographed, given.model, given.config.trajectory)
        return needed_views(
            candidates,
            given.inputs["trajectory"],
            load_field(given.inputs["field"]),
            given.model.space,
            given.config,
            device_named(self.device),
        )


class TrajectoryFrames(PathRenders):
    """The unstylised frames of the fly-through, or of another path.

    Also leaves `support.json`: the share of their pixels that fewer than three photographs see.
    """

    tools = ("av", "numba", "opencv-contrib-python-headless", "pycolmap", "torch")

    def values(self) -> dict[str, Any]:
        """The settings, those of the command's own words among them."""
        return super().values() | self.path_settings()

    def identity_parameters(self) -> Mapping[str, object]:
        """The settings, and which path."""
        return {**super().identity_parameters(), **self.path_identity()}

    def external_digests(self) -> Mapping[str, str]:
        """The digests of the files that have the path."""
        return self.path_digests()

    def frame_count(self) -> int | None:
        """How many frames the settings ask for; None where they are no numbers."""
        words = {"frames": 60, "seconds": 0, "speed": 1}
        values = self.values()
        found = [values.get(f"trajectory.{word}", usual) for word, usual in words.items()]
        found.append(values.get("frames_per_second", 24))
        if not all(isinstance(value, int | float) and value >= 0 for value in found):
            return None
        frames, seconds, speed, rate = found
        return round(float((seconds * rate or frames) / (speed or 1)))

    def config(self, values: Mapping[str, Any]) -> Any:
        """Path and renders."""
        from styletrf.configuration import configured
        from styletrf.trajectory.frames import FramesConfig

        return configured(FramesConfig, values)

    def cameras(self, given: PathSource, out: Path) -> list[Any]:
        """The fly-through, as wide as photographs support it; or the path that is asked for."""
        from styletrf.capture.poses.given_poses import poses_are_given
        from styletrf.devices import device_named
        from styletrf.field.radiance_field import load_field
        from styletrf.files.tables import read_summary
        from styletrf.geometry.camera_table import read_split
        from styletrf.geometry.lenses import at_size
        from styletrf.trajectory.chosen_path import chosen_path, default_path
        from styletrf.trajectory.support import SupportMeter
        from styletrf.trajectory.supported_path import SupportedPath, write_support

        poses, model, config = given.inputs["poses"], given.model, given.config
        fitted = model.normalized(read_split(poses / "cameras.parquet")[0])
        field, device = load_field(given.inputs["field"]), device_named(self.device)
        meter = SupportMeter(fitted, field, model.space, config.support, device)
        of = given.photographed, model, config
        if self.path == "auto":
            tells_depth = read_summary(poses / "poses.json")["tells_depth"]
            found = default_path(*of, meter.measure, tells_depth=tells_depth)
        else:
            path = chosen_path(self.path, *of, are_given=poses_are_given(poses))
            found = SupportedPath(path, meter.measure(path))
        name = self.path if self.path_file() is None else "of the file"
        write_support(out / "support.json", name, found, config.support)
        return [at_size(camera, config.long_side_px, 0.0) for camera in found.cameras]
