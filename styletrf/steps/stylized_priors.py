"""The stylized prior renders."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch

from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.errors import InputError
from styletrf.files.images import read_rgb
from styletrf.geometry.camera_table import read_cameras
from styletrf.geometry.cameras import Camera
from styletrf.steps.sharding import shard_folders, shard_of
from styletrf.steps.step_run import StepRun
from styletrf.style.gatys import GatysConfig
from styletrf.style.training.config import with_style_parameters
from styletrf.stylization.alternation import blend_with_previous_round
from styletrf.stylization.background import (
    EmptyBackground,
    empty_background,
    replace_background,
    restore_background,
)
from styletrf.stylization.color_transfer import Colors, in_colors
from styletrf.stylization.painters import (
    Image,
    Painter,
    load_painted,
    network_painter,
    optimizing_painter,
    painted,
    save_painted,
)
from styletrf.trajectory.frames import float_images, write_pictures


def stylize_priors(
    inputs: Mapping[str, Path],
    out: Path,
    settings: Mapping[str, Any],
    run: StepRun,
    *,
    colors: Colors,
    factors: Sequence[float],
) -> None:
    """Writes `frames/NAME.png` of all priors; a shard leaves `painted.safetensors` instead.

    One color map serves all priors, so a shard keeps its views as they are before.

    Args:
        inputs: `priors` and `style`; without factors `network`; with them `perceptual`, and
            `network` if the start of `settings` is `network` (the default); from the second round
            on also `before`, the field of the previous round, with `field` and `model`; or
            `priors`, `style` and the shards to join. Without `style`, a painting that the network
            may never have seen, views keep the colors of the network.
        out: The folder to fill.
        settings: Those of `GatysConfig`, where pixels are optimized.
        run: Its progress is the number of views.
        colors: The source of the colors; others than `style` need `style` among the inputs.
        factors: The stroke scale and content weight of an optimization of pixels (Gatys et al.),
            which starts from the network's pictures unless its settings say otherwise; empty for a
            network alone.

    Raises:
        ValueError: The input `network` is missing without factors, or `perceptual` with factors.
        InputError: The optimization starts from the network's pictures, and `network` is missing.
    """
    cameras = read_cameras(inputs["priors"] / "cameras.parquet")
    plain = list(float_images(inputs["priors"]))
    background = empty_background(plain)
    if folders := shard_folders(inputs):
        shards = (load_painted(folder / "painted.safetensors") for folder in folders)
        views = [view for shard in shards for view in shard]
    else:
        device = device_named(run.device_name)
        own = shard_of(cameras, run.shard)
        content = _content(inputs, own, background, device)
        paint = _painter(inputs, settings, factors, device)
        views = painted(paint, [camera.name for camera in own], content, run.progress)
    if run.shard:
        save_painted(out / "painted.safetensors", views)
        return
    if colors != "style" or "style" in inputs:
        painting = read_rgb(inputs["style"] / "style.png")
        opacities = [view.opacity for view in plain] if background else None
        seen = replace_background(plain, background)
        views = in_colors(views, seen, painting, colors, opacities)
    shown = restore_background(views, plain, background)
    write_pictures(out, [camera.name for camera in cameras], iter(shown))


def _content(
    inputs: Mapping[str, Path],
    cameras: Sequence[Camera],
    background: EmptyBackground | None,
    device: torch.device,
) -> list[Image]:
    """Returns the images to stylize: the priors, from the second round on blended with renders."""
    views = list(float_images(inputs["priors"], cameras))
    if "before" in inputs:
        views = blend_with_previous_round(views, cameras, inputs, device)
    return replace_background(views, background)


def _painter(
    inputs: Mapping[str, Path],
    settings: Mapping[str, Any],
    factors: Sequence[float],
    device: torch.device,
) -> Painter:
    """Returns the network, or an optimization, which may start from the network's pictures."""
    needed = "perceptual" if factors else "network"
    if needed not in inputs:
        raise ValueError(
            f"inputs have no {needed!r}: priors are stylized by the input 'network', or by factors"
            " and the input 'perceptual'"
        )
    network = network_painter(inputs["network"], device) if "network" in inputs else None
    if network and not factors:
        return network
    config = with_style_parameters(configured(GatysConfig, settings), *factors)
    if config.start == "network" and network is None:
        remedy = "Give the input 'network', or the start 'content' or 'noise'"
        raise InputError("setting 'start'", "is 'network', and no network is given", remedy)
    weights, painting = inputs["perceptual"] / "vgg16.safetensors", inputs["style"] / "style.png"
    return optimizing_painter(weights, painting, config, device, network)
