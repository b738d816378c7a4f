"""Stylization: the priors are stylized, the field is adapted to them, and the path is rendered."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from pipeline.digest import file_digest
from pipeline.task import RunContext
from styletrf.errors import InputError
from tasks.presets.presets import settings_for
from tasks.stages.blending import validate_blend
from tasks.stages.field import PriorRenders, RadianceField, TrajectoryFrames
from tasks.stages.scene import CameraPoses, SceneModel
from tasks.stages.shards import ShardedStage
from tasks.stages.stage import ConfigurableStage, Stage
from tasks.stages.style import StyleImage, StyleNetwork
from tasks.stages.style_parameters import FrameParameters, StyleParameters
from tasks.stages.weights import PerceptualWeights, TransferWeights

_SHARP_ENOUGH = 0.95
"""The fraction of the priors' sharpness for renders that are fitted to pixels alone."""


class StylizedPriors(ShardedStage, StyleParameters):
    """The stylized prior renders: `frames/NAME.png`; a shard leaves `painted.safetensors`.

    From the second round on, the mean of the prior and of the render of the previous round's field
    is stylized (alternation, as in SNeRF, Nguyen-Phuoc et al. 2022).
    """

    tools = ("numba", "opencv-contrib-python-headless", "torch")
    uses_device = True

    def requires(self) -> Mapping[str, Stage]:
        """Returns the renders, the stylizer, the previous round's field, and the shards."""
        needed: dict[str, Stage] = {
            "priors": self.upstream(PriorRenders),
            **self.shard_stages(),
        }
        if not self.keeps_network_colors:
            needed["style"] = self.upstream(StyleImage)
        if self.stylizer != "gatys" or self.values().get("start", "network") == "network":
            needed["network"] = self.upstream(StyleNetwork)
        if self.stylizer == "gatys":
            needed["perceptual"] = self.upstream(PerceptualWeights)
        if self.rounds > 1:
            needed["field"] = self.upstream(RadianceField)
            needed["model"] = self.upstream(SceneModel)
            needed["before"] = self.upstream(StylizedField, rounds=self.rounds - 1)
        return needed

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns the settings of the stylizer, and the source of the colors."""
        return {
            "settings": self.values(),
            "stylizer": "gatys" if self.stylizer == "gatys" else "johnson",
            "colors": self.colors,
            "factors": self.factors(),
            **self.shard_identity(),
        }

    def factors(self) -> list[float]:
        """Returns the factors of an optimization; a network was trained with its own."""
        return [self.stroke_scale, self.content_weight] if self.stylizer == "gatys" else []

    def values(self) -> dict[str, Any]:
        """Returns the settings of the optimization; a network has none."""
        return super().values() if self.stylizer == "gatys" else {}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Stylizes every prior, or those of a shard; one color map serves all of them."""
        from styletrf.steps.stylized_priors import stylize_priors

        stylize_priors(
            inputs,
            out,
            self.values(),
            self.step_run(run),
            colors=cast("Any", self.colors),
            factors=self.factors(),
        )


class StylizedField(ConfigurableStage, StyleParameters):
    """The field in the style of the stylized priors.

    Leaves `appearance.safetensors`, `field.json`, `curve.parquet`, and `density.json`, which names
    the RadianceField whose density it shares; with the strategies s1 and s2 `density.safetensors`.
    """

    tools = ("numba", "opencv-contrib-python-headless", "torch")
    uses_device = True

    def requires(self) -> Mapping[str, Stage]:
        """Returns the field, the priors and their cameras."""
        needed: dict[str, Stage] = {
            "field": self.upstream(RadianceField),
            "model": self.upstream(SceneModel),
            "priors": self.upstream(PriorRenders),
            "stylized": self.upstream(StylizedPriors),
        }
        if self.strategy == "s1":
            needed["poses"] = self.upstream(CameraPoses)
        if self.resolved_match != "pixels":
            needed["style"] = self.upstream(StyleImage)
            needed["perceptual"] = self.upstream(PerceptualWeights)
        if self.resolved_match == "distributions":
            needed["transfer"] = self.upstream(TransferWeights)
        return needed

    @property
    def resolved_match(self) -> str:
        """The last target of the fit: `match`, decided if it is `auto`.

        A loss of renders moves them to the painting and its colors, so it is not for priors with
        other colors, nor for a network that the user brings and whose painting is not known.
        """
        if self.match != "auto":
            return str(self.match)
        has_own_painting = self.colors == "style" and not self.network
        is_usual = self.strategy == "s3" and self.quality != "paper"
        return "distributions" if has_own_painting and is_usual else "pixels"

    def validate(self) -> None:
        """Rejects invalid combinations.

        Raises:
            InputError: Fewer than one round, or a loss on whole renders without s3.
        """
        super().validate()
        if self.rounds < 1:
            raise InputError(f"--rounds {self.rounds}", "is below 1", "Give 1 or more")
        if self.resolved_match != "pixels" and self.strategy != "s3":
            subject = f"--match {self.match} --strategy {self.strategy}"
            problem = "do not go together: only s3 is matched to whole renders"
            raise InputError(subject, problem, "Leave one of them out")

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns the settings, the strategy and the loss."""
        return {
            "settings": self.values(),
            "strategy": self.strategy,
            "match": self.resolved_match,
            **self._render_loss_factors(),
        }

    def _render_loss_factors(self) -> dict[str, list[float]]:
        """Returns the factors of a loss on whole renders; stylized pixels include them already."""
        factors = [self.stroke_scale, self.content_weight]
        return {} if self.resolved_match == "pixels" else {"factors": factors}

    def values(self) -> dict[str, Any]:
        """Returns the settings; s1 and s2 fit as RadianceField does here (`fit.batch`)."""
        fit = settings_for("RadianceField", self.quality) if self.strategy != "s3" else {}
        values = {f"fit.{name}": value for name, value in fit.items()} | super().values()
        matches_renders = self.resolved_match != "pixels" and values["image.iterations"] != 0
        if not matches_renders:  # nothing follows that sharpens the renders
            values = {"weight_power.sharpness": _SHARP_ENOUGH} | values
        return values

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Adapts the appearance (s3), adapts the whole field (s2), or fits a new one (s1)."""
        from styletrf.steps.stylized_field import stylize_field

        stylize_field(
            inputs,
            out,
            self.values(),
            self.step_run(run),
            factors=(self.stroke_scale, self.content_weight),
            strategy=cast("Any", self.strategy),
            match=cast("Any", self.resolved_match),
        )


class StylizedFrames(ShardedStage, FrameParameters):
    """The stylized fly-through: `frames/NAME.png`, `video.mp4`; a shard leaves `cameras.parquet`.

    If the field has its own density (s1, s2), `own_depths/NAME.exr` contains its depth.
    The path and the frame rate are those of TrajectoryFrames.
    """

    tools = ("av", "numba", "opencv-contrib-python-headless", "torch")
    uses_device = True

    def requires(self) -> Mapping[str, Stage]:
        """Returns the density, the appearances and the path; or the network of the frames."""
        needed: dict[str, Stage] = {
            "trajectory": self.upstream(TrajectoryFrames),
            **self.shard_stages(),
        }
        if self.method == "per-frame":
            needed["network"] = self.upstream(StyleNetwork)
            if not self.keeps_network_colors:
                needed["style"] = self.upstream(StyleImage)
            return needed
        needed["field"] = self.upstream(RadianceField)
        needed["stylized"] = self.upstream(StylizedField)
        needed["model"] = self.upstream(SceneModel)
        if "view" in self.region:
            needed["priors"] = self.upstream(PriorRenders)
        for style in self.blend:
            needed[f"blend {style}"] = self.upstream(StylizedField, style=style, network="")
        return needed

    def validate(self) -> None:
        """Rejects invalid combinations.

        Raises:
            InputError: A weight or region is invalid, or the blended fields have no common density.
        """
        super().validate()
        validate_blend(self)

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns the settings, and which styles are blended where."""
        blend = {"strength": self.strength, "blend": dict(self.blend), "region": self._region()}
        part = self.shard_identity()
        own = {"own_depths": True} if self.has_own_depths else {}
        return {"settings": self.values(), "method": self.method, **blend, **part, **own}

    @property
    def has_own_depths(self) -> bool:
        """Whether the rendered field has its own density instead of RadianceField's."""
        return bool(self.method == "field" and self.strategy != "s3")

    def external_digests(self) -> Mapping[str, str]:
        """Returns the digest of the mask."""
        mask = self.region.get("mask")
        return {"mask": file_digest(Path(mask))} if mask else {}

    def _region(self) -> dict[str, Any]:
        """Returns the region without the path of its mask."""
        return {name: value for name, value in self.region.items() if name != "mask"}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Renders the stylized path, or joins its shards."""
        from styletrf.steps.stylized_frames import Blend, render_stylized

        render_stylized(
            inputs,
            out,
            self.values(),
            self.step_run(run),
            blend=Blend(self.strength, self.blend, self.region),
            writes_depths=self.has_own_depths,
        )
