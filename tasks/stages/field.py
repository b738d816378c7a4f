"""The radiance field and its renders."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from pipeline.parameters import NameParameter
from pipeline.task import RunContext
from tasks.stages.path_parameters import PathParameters
from tasks.stages.scene import CameraPoses, SceneModel
from tasks.stages.shards import ShardedStage
from tasks.stages.stage import ConfigurableStage, Stage


class RadianceField(ConfigurableStage):
    """A TensoRF fitted to all photographs but those held out.

    Leaves `density.safetensors`, `appearance.safetensors`, `field.json` and `curve.parquet`. A
    killed run goes on from its last checkpoint.
    """

    scene = NameParameter(description="a folder in data/scenes")
    tools = ("numba", "opencv-contrib-python-headless", "torch")
    uses_device = True

    def requires(self) -> Mapping[str, Stage]:
        """Returns the images with their cameras, and the scene model."""
        return {"poses": self.upstream(CameraPoses), "model": self.upstream(SceneModel)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Fits the field."""
        from styletrf.steps.radiance_field import fit_field

        fit_field(inputs, out, self.values(), self.step_run(run))


class PathRenders(ShardedStage, PathParameters):
    """Float renders of the field along a path.

    Leaves `frames/NAME.exr` (R G B A half, Z float), `cameras.parquet` and `video.mp4`; a shard
    leaves its frames and all cameras.
    """

    scene = NameParameter(description="a folder in data/scenes")
    tools: ClassVar[tuple[str, ...]] = ("av", "numba", "opencv-contrib-python-headless", "torch")
    uses_device = True

    def requires(self) -> Mapping[str, Stage]:
        """Returns the field, the cameras and the model that place the path, and the shards."""
        return {
            "field": self.upstream(RadianceField),
            "poses": self.upstream(CameraPoses),
            "model": self.upstream(SceneModel),
            **self.shard_stages(),
        }


class PriorRenders(PathRenders):
    """Renders of the few views to stylize, which together cover all that the path sees."""

    def requires(self) -> Mapping[str, Stage]:
        """Returns the inputs of a path, and the trajectory that the priors have to cover."""
        return {**super().requires(), "trajectory": self.upstream(TrajectoryFrames)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Chooses and renders the views, or joins their shards."""
        from styletrf.steps.prior_renders import render_priors

        render_priors(inputs, out, self.values(), self.step_run(run))


class TrajectoryFrames(PathRenders):
    """The unstylized frames of the fly-through, or of another path.

    Also leaves `support.json`: the fraction of pixels that fewer than three photographs see.
    """

    tools = ("av", "numba", "opencv-contrib-python-headless", "pycolmap", "torch")

    def values(self) -> dict[str, Any]:
        """Returns the settings, including the path parameters."""
        return super().values() | self.path_settings()

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns the settings and the path."""
        return {**super().identity_parameters(), **self.path_identity()}

    def external_digests(self) -> Mapping[str, str]:
        """Returns the digests of the files that contain the path."""
        return self.path_digests()

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Chooses and renders the path, or joins its shards."""
        from styletrf.steps.trajectory_frames import render_trajectory

        name = self.path if self.path_file() is None else "of the file"
        render_trajectory(
            inputs, out, self.values(), self.step_run(run), path=self.path, path_name=name
        )
