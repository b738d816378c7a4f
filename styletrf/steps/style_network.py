"""A style network for one painting: trained, converted, or conditioned on the painting."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch

from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.evaluation.consistency.frame_pairs import PairPlan, planned_pairs
from styletrf.files.images import read_rgb
from styletrf.files.tables import read_summary, write_curve
from styletrf.geometry.camera_table import read_cameras
from styletrf.progress import Progress
from styletrf.style.interchange import from_fast_neural_style
from styletrf.style.perceptual.vgg import load_vgg
from styletrf.style.style_network import save_style_network
from styletrf.style.training.config import StyleTrainingConfig, with_style_parameters
from styletrf.style.training.data_parallel import joined
from styletrf.style.training.render_pairs import RenderPairs
from styletrf.style.training.trainer import train_style_network
from styletrf.style.transfer.weights import load_style_transfer
from styletrf.trajectory.stills import cuts_of


@dataclass(frozen=True, slots=True)
class NetworkTraining:
    """What to train.

    Attributes:
        settings: Of `StyleTrainingConfig`.
        stroke_scale: Factor of the size of the strokes.
        content_weight: Factor of the weight of the content.
        inputs: `style`, `content`, `perceptual`; `transfer` for a warm start; `renders` of the
            scene, if the temporal loss uses them.
        measured: The settings of `PairPlan` whose pairs are measured, and kept out.
    """

    settings: Mapping[str, Any]
    stroke_scale: float
    content_weight: float
    inputs: Mapping[str, Path]
    measured: Mapping[str, Any] = field(default_factory=dict)

    @property
    def config(self) -> StyleTrainingConfig:
        """The settings with the factors applied."""
        config = configured(StyleTrainingConfig, self.settings)
        return with_style_parameters(config, self.stroke_scale, self.content_weight)


def train_network(
    training: NetworkTraining, out: Path, device_name: str, progress: Progress, checkpoints: Path
) -> None:
    """Writes the network and `curve.parquet`; under torchrun, this process is one of several.

    Args:
        training: What to train.
        out: The folder to fill.
        device_name: `auto`, `cpu` or `cuda`.
        progress: Called with the iteration and the loss.
        checkpoints: A folder from which an interrupted training continues.
    """
    inputs, config, device = training.inputs, training.config, device_named(device_name)
    ranks = joined(device)
    if device.type == "cuda":
        torch.cuda.set_device(ranks.rank)
    style = torch.from_numpy(read_rgb(inputs["style"] / "style.png"))
    initial = predictor = None
    if config.warm_start:
        transfer = load_style_transfer(inputs["transfer"], device)
        initial, predictor = transfer.network_for(style.to(device)), transfer.predictor
    network, curve = train_style_network(
        config,
        load_vgg(inputs["perceptual"] / "vgg16.safetensors", device),
        style,
        inputs["content"],
        checkpoint_folder=checkpoints,
        initial=initial,
        predictor=predictor,
        pairs=_pairs_to_train_on(training, config) if "renders" in inputs else None,
        progress=progress,
        ranks=ranks,
    )
    if ranks.is_first:
        save_style_network(network, out)
        write_curve(out / "curve.parquet", curve)


def _pairs_to_train_on(training: NetworkTraining, config: StyleTrainingConfig) -> RenderPairs:
    """Returns the pairs of renders except those that are measured."""
    renders = training.inputs["renders"]
    n_renders = len(read_cameras(renders / "cameras.parquet"))
    cuts = cuts_of(read_summary(renders / "support.json"))
    planned = planned_pairs(n_renders, configured(PairPlan, training.measured), cuts)
    return RenderPairs(
        renders,
        batch=config.batch,
        crop_px=config.crop_px,
        seed=config.seed,
        measured={(pair.first, pair.second) for pair in planned},
    )


def convert_network(checkpoint: Path, out: Path) -> None:
    """Writes a checkpoint of PyTorch's fast-neural-style example as a style network."""
    save_style_network(from_fast_neural_style(checkpoint), out)


def conditioned_network(inputs: Mapping[str, Path], out: Path) -> None:
    """Writes the network of arbitrary style transfer, conditioned on a painting.

    Args:
        inputs: `style` and `transfer`.
        out: The folder to fill.
    """
    painting = torch.from_numpy(read_rgb(inputs["style"] / "style.png"))
    save_style_network(load_style_transfer(inputs["transfer"]).network_for(painting), out)
