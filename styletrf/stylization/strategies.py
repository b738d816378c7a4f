"""Stylizes a field by painted views, with each strategy of the paper and each loss of ours."""

import logging
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from styletrf.capture.views import load_views
from styletrf.configuration import require_at_least, require_within
from styletrf.devices import is_faster_in_bfloat16
from styletrf.field.kernels import Kernels, kernels_for
from styletrf.field.radiance_field import RadianceField, load_field, refine_appearance
from styletrf.field.shading import ShadingKind
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
from styletrf.files.images import read_rgb, to_integers
from styletrf.geometry.camera_table import read_cameras
from styletrf.geometry.cameras import Camera
from styletrf.progress import Progress, silent
from styletrf.scene.free_space import free_space
from styletrf.scene.scene_model import SceneModel, read_scene_model
from styletrf.scene.training_photographs import read_training_photographs
from styletrf.style.perceptual.painting_size import scale_warnings, scaled_painting
from styletrf.style.perceptual.perceptual_loss import PerceptualLossConfig
from styletrf.style.perceptual.predictor_features import LEAST_PX
from styletrf.style.perceptual.style_loss import StyleLoss
from styletrf.style.perceptual.vgg import load_vgg
from styletrf.style.transfer.weights import load_style_transfer
from styletrf.stylization.adaptation import AdaptationConfig, AdaptationCurvePoint, adapt_appearance
from styletrf.stylization.background import EmptyBackground, empty_background
from styletrf.stylization.content_constraint import ConstrainedContentLoss, ContentConstraintConfig
from styletrf.stylization.full_adaptation import finetune_all, fit_new_field
from styletrf.stylization.image_adaptation import ImageAdaptationConfig, adapt_to_image_loss
from styletrf.stylization.power_choice import PowerChoiceConfig, choose_weight_power
from styletrf.stylization.style_lattice import StyleLatticeConfig, lattice_scale
from styletrf.stylization.surface_ownership import OwnershipConfig, owned_pixels
from styletrf.stylization.view_windows import ImageLoss
from styletrf.trajectory.frames import float_images

Match = Literal["pixels", "gram", "distributions"]
_LOGGER = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class StylizationConfig:
    """Settings of the stylization of a field."""

    adaptation: AdaptationConfig = field(default_factory=AdaptationConfig)
    single_owner: bool = True  # every surface point learns from one prior, else from all
    ownership: OwnershipConfig = field(default_factory=OwnershipConfig)
    appearance_scale: float = 0.0  # of the style's lattice; 0: as the priors require
    style_lattice: StyleLatticeConfig = field(default_factory=StyleLatticeConfig)
    shading: ShadingKind = "plain"  # of the style
    fit_fraction: float = 0.4  # of the adaptation's iterations, where renders are matched after
    weight_power: PowerChoiceConfig = field(default_factory=PowerChoiceConfig)  # of the style
    image: ImageAdaptationConfig = field(default_factory=ImageAdaptationConfig)
    image_loss: PerceptualLossConfig = field(default_factory=PerceptualLossConfig)
    content: ContentConstraintConfig = field(
        default_factory=ContentConstraintConfig
    )  # in that loss
    image_bfloat16: bool = True  # the perceptual network in bfloat16 where it is faster
    style_px: int = 420  # of the painting, in the loss of renders
    stroke_scale: float = 1.0  # of that side; see `scaled_painting`
    fit: FieldTrainingConfig = field(default_factory=FieldTrainingConfig)  # of S1 and S2

    def __post_init__(self) -> None:
        require_at_least(LEAST_PX, self, "style_px")
        require_within("(0, 1]", self, "fit_fraction")
        require_within("[0, inf)", self, "appearance_scale")
        require_within("(0, inf)", self, "stroke_scale")
        if self.shading == "plain" and set(self.adaptation.parts) == {"network"}:
            raise ValueError("adaptation.parts is 'network', which the shading 'plain' lacks")

    def with_style_parameters(
        self, stroke_scale: float, content_weight: float
    ) -> "StylizationConfig":
        """Returns the settings with two factors of the style parameters applied."""
        loss = replace(
            self.image_loss, content_weight=content_weight * self.image_loss.content_weight
        )
        content = replace(self.content, level=self.content.level / content_weight)
        scale = stroke_scale * self.stroke_scale
        return replace(self, stroke_scale=scale, image_loss=loss, content=content)


@dataclass(frozen=True, slots=True)
class Stylization:
    """The input of a stylization: a field, its views before and after painting, and the style."""

    field: RadianceField
    model: SceneModel
    cameras: Sequence[Camera]
    depths: Sequence[Float[np.ndarray, "height width"]]
    unstylized: Tensor  # views height width 3, uint8
    painted: Tensor
    kernels: Kernels
    style: Mapping[str, Path] | None  # the painting, and the weights of a loss of renders
    match: Match
    free: Bool[Tensor, "cells cells cells"] | None = None  # of the grid, for a new field
    background: EmptyBackground | None = None  # of the unstylized views


def load_stylization(inputs: Mapping[str, Path], device: torch.device, match: Match) -> Stylization:
    """Returns the content of the folders: field, model, priors, stylized; painting, weights; poses.

    With `poses`, whose photographs the field was fitted to, also the space that is free by them.
    """
    cameras = read_cameras(inputs["priors"] / "cameras.parquet")
    priors = list(float_images(inputs["priors"]))
    unstylized = [torch.from_numpy(to_integers(image.color)) for image in priors]
    names = () if match == "pixels" else ("style", "perceptual", "transfer")
    style = {name: inputs[name] for name in names if name in inputs}
    model = read_scene_model(inputs["model"] / "scene.json")
    free = None
    if "poses" in inputs:
        photographs = read_training_photographs(inputs["poses"])
        free = torch.from_numpy(free_space(model, photographs.cameras, photographs.points))
    return Stylization(
        field=load_field(inputs["field"]).to(device),
        model=model,
        cameras=cameras,
        depths=[image.depth for image in priors],
        unstylized=torch.stack(unstylized).to(device),
        painted=torch.stack(load_views(inputs["stylized"] / "frames", cameras, device)),
        kernels=kernels_for(device),
        style=style or None,
        match=match,
        free=free,
        background=empty_background(priors),
    )


def stylized(
    job: Stylization, config: StylizationConfig, progress: Progress = silent
) -> tuple[RadianceField, list[AdaptationCurvePoint], float]:
    """Returns the field with its appearance adapted (S3), the curve, and the mass left out."""
    generator = torch.Generator().manual_seed(config.adaptation.seed)
    refine_appearance(job.field, _lattice_scale(job, config), config.shading, generator)
    job.field.appearance.weight_power = config.weight_power.powers[-1]  # fits what it shows best
    first = config.adaptation
    matches_renders = job.match != "pixels" and config.image.iterations > 0
    if matches_renders:
        first = replace(first, iterations=math.ceil(config.fit_fraction * first.iterations))
    started = time.monotonic()
    curve, dropped = adapt_appearance(
        job.field, job.cameras, job.painted, job.model.space, first, job.kernels,
        progress, _learnt_pixels(job, config),
    )  # fmt: skip
    choose_weight_power(job.field, job.cameras, job.painted, job.model.space, config.weight_power)
    if matches_renders:
        seconds = time.monotonic() - started
        after = adapt_to_image_loss(
            job.field, job.cameras, (job.unstylized, job.painted), job.model.space,
            _image_loss(job, config),
            config.image, config.adaptation, job.kernels, progress, job.background,
        )  # fmt: skip
        curve += [
            AdaptationCurvePoint(first.iterations + p.iteration, seconds + p.seconds, p.psnr)
            for p in after
        ]
    return job.field, curve, dropped


def stylized_with_own_density(
    job: Stylization,
    config: StylizationConfig,
    progress: Progress = silent,
    *,
    from_scratch: bool,
) -> tuple[RadianceField, list[AdaptationCurvePoint]]:
    """Returns a field fitted to the painted views alone (S1), or the field fitted on (S2).

    `config.fit` has the settings of both, but for those that the strategies decide: the shading is
    the scene's, see also `fit_new_field` and `finetune_all`. S2 sees as many rays as the adaptation
    of the appearance to the painted views alone does, which decides `iterations` and
    `batch_samples`.
    """
    shading = replace(config.fit.field, shading=job.model.shading)
    training, space = replace(config.fit, field=shading), job.model.space
    views = TrainingViews(job.cameras, job.painted)
    if from_scratch:
        volume = FieldVolume(space, job.model.resolution, job.free)
        return fit_new_field(views, volume, training, job.kernels, progress)
    rays = config.adaptation.iterations * config.adaptation.batch
    training = replace(training, iterations=max(1, rays // training.batch), batch_samples=0)
    return finetune_all(job.field, views, space, training, job.kernels, progress)


def _lattice_scale(job: Stylization, config: StylizationConfig) -> float:
    """Returns the scale of the style's lattice that is set, or else that the priors require."""
    if config.appearance_scale > 0:
        return config.appearance_scale
    space, factors = job.model.space.within(job.field.bounds), job.field.appearance.factors
    return lattice_scale(space, factors.resolution, job.cameras, job.depths, config.style_lattice)


def _learnt_pixels(job: Stylization, config: StylizationConfig) -> Tensor | None:
    """Returns the pixels, numbered through all priors, that their surface learns from."""
    if not config.single_owner:
        return None
    masks = owned_pixels(job.cameras, job.depths, config.ownership)
    return torch.from_numpy(np.flatnonzero(np.stack(masks)))


def _image_loss(job: Stylization, config: StylizationConfig) -> ImageLoss:
    """Returns the loss of a render: that of the style network, or one of VGG16's Gram matrices."""
    if job.style is None:
        raise ValueError("no style to match")
    device = job.unstylized.device
    vgg = load_vgg(job.style["perceptual"] / "vgg16.safetensors", device)
    if config.image_bfloat16 and is_faster_in_bfloat16(device):
        vgg = vgg.to(torch.bfloat16)
    painting = torch.from_numpy(read_rgb(job.style["style"] / "style.png")).to(device)
    predictor = None
    if job.match == "distributions":
        predictor = load_style_transfer(job.style["transfer"], device).predictor
        predictor.requires_grad_(requires_grad=False)
    size = config.style_px, config.stroke_scale
    for warning in scale_warnings(painting.shape, *size):
        _LOGGER.warning(warning)
    loss = StyleLoss(
        vgg,
        scaled_painting(painting, *size),
        config.image_loss,
        "sliced" if job.match == "distributions" else "gram",
        predictor,
    )
    return ConstrainedContentLoss(loss, config.image_loss, config.content)
