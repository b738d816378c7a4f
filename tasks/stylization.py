"""Scene and style meet: the priors are painted, the field takes them on, and the path is shown."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from pipeline.digest import file_digest
from pipeline.task import RunContext
from styletrf.errors import InputError
from tasks.controls import FrameControls, StyleControls
from tasks.field import PriorRenders, RadianceField, TrajectoryFrames
from tasks.qualities import settings_for
from tasks.scene import CameraPoses, SceneModel
from tasks.shards import ShardedStage, parts_in
from tasks.stage import Stage, TunedStage
from tasks.style import PerceptualWeights, StyleImage, StyleNetwork


class StylizedPriors(ShardedStage, StyleControls):
    """The prior renders, painted: `frames/NAME.png`; of a part, `painted.safetensors`.

    From the second round on, what is painted is half the prior and half what the field shows that
    was adapted to the round before (as SNeRF, Nguyen-Phuoc et al. 2022, goes to and fro).
    """

    tools = ("numba", "opencv-contrib-python-headless", "torch")
    computes = True

    def requires(self) -> Mapping[str, Stage]:
        """The renders, what paints them, the field of the round before, and the parts."""
        needed: dict[str, Stage] = {
            "priors": self.need(PriorRenders),
            "style": self.need(StyleImage),
            **self.parts(),
        }
        if self.stylizer != "gatys" or self.values().get("start", "network") == "network":
            needed["network"] = self.need(StyleNetwork)
        if self.stylizer == "gatys":
            needed["perceptual"] = self.need(PerceptualWeights)
        if self.rounds > 1:
            needed["field"] = self.need(RadianceField)
            needed["model"] = self.need(SceneModel)
            needed["before"] = self.need(StylizedField, rounds=self.rounds - 1)
        return needed

    def identity_parameters(self) -> Mapping[str, object]:
        """The settings of what paints, and whose colours."""
        return {
            "settings": self.values(),
            "stylizer": "gatys" if self.stylizer == "gatys" else "johnson",
            "colors": self.colors,
            "factors": self.factors(),
            **self.identity_of_part(),
        }

    def factors(self) -> list[float]:
        """Those that steer an optimisation; a network was trained with its own."""
        return [self.stroke_scale, self.content_weight] if self.stylizer == "gatys" else []

    def values(self) -> dict[str, Any]:
        """The settings of the optimisation; a network has none."""
        return super().values() if self.stylizer == "gatys" else {}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Paint every prior, or those of a part; colours are those of all of them together."""
        from styletrf.files.images import read_rgb
        from styletrf.geometry.camera_table import read_cameras
        from styletrf.stylization.background import after_painting, before_painting, empty_ground
        from styletrf.stylization.color_transfer import Colors, in_colors
        from styletrf.stylization.painters import load_painted, save_painted
        from styletrf.trajectory.frames import float_images, write_pictures

        cameras = read_cameras(inputs["priors"] / "cameras.parquet")
        plain = list(float_images(inputs["priors"]))
        ground = empty_ground(plain)
        if parts := parts_in(inputs):
            views = [view for part in parts for view in load_painted(part / "painted.safetensors")]
        else:
            views = self._painted(self.of_part(cameras), ground, inputs, run)
        if self.shard:
            save_painted(out / "painted.safetensors", views)
            return
        painting, content = read_rgb(inputs["style"] / "style.png"), before_painting(plain, ground)
        colored = in_colors(views, content, painting, cast("Colors", self.colors))
        shown = after_painting(colored, plain, ground)
        write_pictures(out, [camera.name for camera in cameras], iter(shown))

    def _painted(
        self, cameras: Sequence[Any], ground: Any, inputs: Mapping[str, Path], run: RunContext
    ) -> list[Any]:
        from styletrf.configuration import configured
        from styletrf.devices import device_named
        from styletrf.style.gatys import GatysConfig
        from styletrf.style.training.config import steered
        from styletrf.stylization.alternation import halfway_to
        from styletrf.stylization.background import before_painting
        from styletrf.stylization.painters import network_painter, optimizing_painter, painted
        from styletrf.trajectory.frames import float_images

        device = device_named(self.device)
        views = list(float_images(inputs["priors"], cameras))
        if "before" in inputs:
            views = halfway_to(views, cameras, inputs, device)
        content = before_painting(views, ground)
        network = network_painter(inputs["network"], device) if "network" in inputs else None
        if network and self.stylizer != "gatys":
            return painted(network, content, run.progress)
        config = steered(configured(GatysConfig, self.values()), *self.factors())
        weights, style = inputs["perceptual"] / "vgg16.safetensors", inputs["style"]
        paint = optimizing_painter(weights, style / "style.png", config, device, network)
        return painted(paint, content, run.progress)


class StylizedField(TunedStage, StyleControls):
    """The field in the style of the painted priors.

    Leaves `appearance.safetensors`, `field.json`, `curve.parquet`, and `density.json`, which names
    the RadianceField whose density it shares; with the strategies s1 and s2 `density.safetensors`.
    """

    tools = ("numba", "opencv-contrib-python-headless", "torch")
    computes = True

    def requires(self) -> Mapping[str, Stage]:
        """The field, the priors and where they were seen from."""
        needed: dict[str, Stage] = {
            "field": self.need(RadianceField),
            "model": self.need(SceneModel),
            "priors": self.need(PriorRenders),
            "stylized": self.need(StylizedPriors),
        }
        if self.strategy == "s1":
            needed["poses"] = self.need(CameraPoses)
        if self.match != "pixels":
            needed["style"] = self.need(StyleImage)
            needed["perceptual"] = self.need(PerceptualWeights)
        return needed

    def require_sound(self) -> None:
        """Refuses what does not go together.

        Raises:
            InputError: Fewer than one round, or a loss of whole renders without s3.
        """
        super().require_sound()
        if self.rounds < 1:
            raise InputError(f"--rounds {self.rounds}", "paints nothing", "Give 1 or more")
        if self.match != "pixels" and self.strategy != "s3":
            told = f"--match {self.match} --strategy {self.strategy}"
            raise InputError(told, "only s3 is matched to whole renders", "Leave one of them out")

    def identity_parameters(self) -> Mapping[str, object]:
        """The settings, and what is made by them."""
        return {
            "settings": self.values(),
            "strategy": self.strategy,
            "match": self.match,
            **self._render_loss_factors(),
        }

    def _render_loss_factors(self) -> dict[str, list[float]]:
        """The factors of a loss of whole renders; painted pixels have been steered already."""
        factors = [self.stroke_scale, self.content_weight]
        return {} if self.match == "pixels" else {"factors": factors}

    def values(self) -> dict[str, Any]:
        """The settings; s1 and s2 fit as RadianceField does at this quality (`fit.iterations`)."""
        fit = settings_for("RadianceField", self.quality) if self.strategy != "s3" else {}
        return {f"fit.{name}": value for name, value in fit.items()} | super().values()

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Adapt the appearance, or all of the field, or fit a new one."""
        from styletrf.configuration import configured
        from styletrf.devices import device_named
        from styletrf.field.radiance_field import save_appearance, save_field
        from styletrf.files.tables import write_curve
        from styletrf.stylization.strategies import (
            Match,
            StylizationConfig,
            freely_stylized,
            load_stylization,
            stylized,
        )

        config = configured(StylizationConfig, self.values())
        config = config.steered(self.stroke_scale, self.content_weight)
        job = load_stylization(inputs, device_named(self.device), cast("Match", self.match))
        if self.strategy == "s3":
            field, curve, dropped = stylized(job, config, run.progress)
            save_appearance(out, field)
        else:
            field, curve = freely_stylized(job, config, run.progress, anew=self.strategy == "s1")
            dropped = 0.0
            save_field(out, field)
        write_curve(out / "curve.parquet", curve)
        shared = inputs["field"].name if self.strategy == "s3" else None
        told = {"density_of": shared, "dropped_weight": dropped}
        (out / "density.json").write_text(json.dumps(told, indent=1, sort_keys=True) + "\n")


class StylizedFrames(ShardedStage, FrameControls):
    """The fly-through in style: `frames/NAME.png` and `video.mp4`; of a part `cameras.parquet`.

    Where the field has a density of its own (s1, s2), `own_depths/NAME.exr` has its depth.
    Path and frame rate are those of TrajectoryFrames.
    """

    tools = ("av", "numba", "opencv-contrib-python-headless", "torch")
    computes = True

    def requires(self) -> Mapping[str, Stage]:
        """The density, the appearances, and the path; or the network that paints each frame."""
        needed: dict[str, Stage] = {"trajectory": self.need(TrajectoryFrames), **self.parts()}
        if self.method == "per-frame":
            painters = {"network": self.need(StyleNetwork), "style": self.need(StyleImage)}
            return {**needed, **painters}
        needed["field"] = self.need(RadianceField)
        needed["stylized"] = self.need(StylizedField)
        needed["model"] = self.need(SceneModel)
        if "view" in self.region:
            needed["priors"] = self.need(PriorRenders)
        for style in self.blend:
            needed[f"blend {style}"] = self.need(StylizedField, style=style, network="")
        return needed

    def require_sound(self) -> None:
        """Refuses what does not go together.

        Raises:
            InputError: Shares that are none, a region that is none, or a mixture of what does not
                share its density.
        """
        from tasks.mixing import require_mixture

        super().require_sound()
        require_mixture(self)

    def identity_parameters(self) -> Mapping[str, object]:
        """The settings, and what is mixed where."""
        words = {"strength": self.strength, "blend": dict(self.blend), "region": self._region()}
        part = self.identity_of_part()
        own = {"own_depths": True} if self.has_own_depths else {}
        return {"settings": self.values(), "method": self.method, **words, **part, **own}

    @property
    def has_own_depths(self) -> bool:
        """Whether the frames are of a field whose density is not that of RadianceField."""
        return bool(self.method == "field" and self.strategy != "s3")

    def external_digests(self) -> Mapping[str, str]:
        """The digest of the mask."""
        mask = self.region.get("mask")
        return {"mask": file_digest(Path(mask))} if mask else {}

    def _region(self) -> dict[str, Any]:
        """The region but for where its mask lies."""
        return {name: value for name, value in self.region.items() if name != "mask"}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Render the path in style, or put its parts together."""
        from styletrf.files.images import read_rgb
        from styletrf.files.video import video_info
        from styletrf.geometry.camera_table import read_cameras, write_cameras
        from styletrf.trajectory.frames import join_pictures, write_clip

        cameras = read_cameras(inputs["trajectory"] / "cameras.parquet")
        if parts := parts_in(inputs):
            join_pictures(parts, out)
        else:
            self.render(self.of_part(cameras), inputs, out, run.progress)
        if self.shard:
            write_cameras(out / "cameras.parquet", self.of_part(cameras))
            return
        images = (read_rgb(out / "frames" / f"{camera.name}.png") for camera in cameras)
        rate = video_info(inputs["trajectory"] / "video.mp4").frames_per_second
        write_clip(out / "video.mp4", images, rate)

    def render(
        self, cameras: Sequence[Any], inputs: Mapping[str, Path], out: Path, progress: Any
    ) -> None:
        """Writes `frames/NAME.png` of some of the path's cameras."""
        from styletrf.configuration import configured
        from styletrf.devices import device_named
        from styletrf.evaluation.consistency.frame_pairs import OWN_DEPTHS
        from styletrf.field.rendering import RenderConfig
        from styletrf.trajectory.frames import write_pictures
        from tasks.mixing import Mixture, frames_by_network, frames_of_field

        mixture = Mixture(self.strength, self.blend, self.region)
        if depths := out / OWN_DEPTHS if self.has_own_depths else None:
            depths.mkdir()
        device, render = device_named(self.device), configured(RenderConfig, self.values())
        frames: Iterator[Any] = (
            frames_by_network(mixture, inputs, cameras, device, progress)
            if "network" in inputs
            else frames_of_field(mixture, inputs, cameras, render, device, progress, depths)
        )
        write_pictures(out, [camera.name for camera in cameras], frames)
