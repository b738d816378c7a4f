"""A style network for one painting: trained, converted, or conditioned on the painting."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.evaluation.consistency.frame_pairs import planned_pairs
from styletrf.evaluation.consistency.pair_plan import PairPlan
from styletrf.files.images import read_rgb
from styletrf.files.tables import read_summary, write_curve
from styletrf.geometry.camera_table import read_cameras
from styletrf.steps.step_run import StepRun
from styletrf.style.interchange import from_fast_neural_style
from styletrf.style.perceptual.vgg import load_vgg
from styletrf.style.style_network import save_style_network
from styletrf.style.training.config import StyleTrainingConfig, with_style_parameters
from styletrf.style.training.data_parallel import joined
from styletrf.style.training.render_pairs import RenderPairs
from styletrf.style.training.trainer import train_style_network
from styletrf.style.transfer.weights import load_style_transfer
from styletrf.trajectory.stills import cuts_of


def train_network(
    inputs: Mapping[str, Path],
    out: Path,
    settings: Mapping[str, Any],
    run: StepRun,
    *,
    factors: tuple[float, float],
    measured: Mapping[str, Any],
) -> None:
    """Writes the network and `curve.parquet`; under torchrun, this process is one of several.

    Args:
        inputs: `style`, `content`, `perceptual`; `transfer` for a warm start; `renders` of the
            scene, if the temporal loss uses them.
        out: The folder to fill.
        settings: Those of `StyleTrainingConfig`.
        run: Its progress is the iteration and the loss.
        factors: The factors of the size of the strokes and of the weight of the content.
        measured: The settings of the `PairPlan` whose pairs are measured, and so not trained on.
    """
    config = with_style_parameters(configured(StyleTrainingConfig, settings), *factors)
    device = device_named(run.device_name)
    ranks = joined(device)
    if device.type == "cuda":
        torch.cuda.set_device(ranks.rank)
    style = torch.from_numpy(read_rgb(inputs["style"] / "style.png"))
    initial = predictor = None
    if config.warm_start:
        transfer = load_style_transfer(inputs["transfer"], device)
        initial, predictor = transfer.network_for(style.to(device)), transfer.predictor
    pairs = None
    if "renders" in inputs:
        pairs = _pairs_to_train_on(inputs["renders"], config, measured)
    network, curve = train_style_network(
        config,
        load_vgg(inputs["perceptual"] / "vgg16.safetensors", device),
        style,
        inputs["content"],
        checkpoint_folder=run.work,
        initial=initial,
        predictor=predictor,
        pairs=pairs,
        progress=run.progress,
        ranks=ranks,
    )
    if ranks.is_first:
        save_style_network(network, out)
        write_curve(out / "curve.parquet", curve)


def _pairs_to_train_on(
    renders: Path, config: StyleTrainingConfig, measured: Mapping[str, Any]
) -> RenderPairs:
    """Returns the pairs of renders except those that are measured."""
    n_renders = len(read_cameras(renders / "cameras.parquet"))
    cuts = cuts_of(read_summary(renders / "support.json"))
    planned = planned_pairs(n_renders, configured(PairPlan, measured), cuts)
    return RenderPairs(
        renders,
        batch=config.batch,
        crop_px=config.crop_px,
        seed=config.seed,
        measured={(pair.first, pair.second) for pair in planned},
    )


def convert_network(
    inputs: Mapping[str, Path],
    out: Path,
    settings: Mapping[str, Any],
    run: StepRun,
    *,
    checkpoint: Path,
) -> None:
    """Writes a checkpoint of PyTorch's fast-neural-style example as a style network.

    Args:
        inputs: Empty.
        out: The folder to fill.
        settings: Empty.
        run: Not used.
        checkpoint: The user's file.
    """
    save_style_network(from_fast_neural_style(checkpoint), out)


def condition_network(
    inputs: Mapping[str, Path], out: Path, settings: Mapping[str, Any], run: StepRun
) -> None:
    """Writes the network of arbitrary style transfer, conditioned on a painting.

    Args:
        inputs: `style` and `transfer`.
        out: The folder to fill.
        settings: Empty.
        run: Not used.
    """
    painting = torch.from_numpy(read_rgb(inputs["style"] / "style.png"))
    save_style_network(load_style_transfer(inputs["transfer"]).network_for(painting), out)
