"""The stylized prior renders."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.files.images import read_rgb
from styletrf.geometry.camera_table import read_cameras
from styletrf.geometry.cameras import Camera
from styletrf.progress import Progress
from styletrf.steps.sharding import Sharding
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
    load_painted,
    network_painter,
    optimizing_painter,
    painted,
    save_painted,
)
from styletrf.trajectory.frames import float_images, write_pictures


@dataclass(frozen=True, slots=True)
class ViewStylization:
    """How views are stylized.

    Attributes:
        inputs: `priors` and `style`; `network` or `perceptual` of the stylizer; from the second
            round on also `before`, the field of the previous round, with `field` and `model`.
        colors: The source of the colors.
        by_optimization: Whether pixels are optimized (Gatys et al.) instead of using the network.
        settings: Of `GatysConfig`.
        factors: Stroke scale and content weight of the optimization.
        device_name: `auto`, `cpu` or `cuda`.
    """

    inputs: Mapping[str, Path]
    colors: Colors
    by_optimization: bool
    settings: Mapping[str, Any]
    factors: tuple[float, float]
    device_name: str


def stylize_priors(job: ViewStylization, out: Path, sharding: Sharding, progress: Progress) -> None:
    """Writes `frames/NAME.png` of all priors; a shard leaves `painted.safetensors` instead.

    One color map serves all priors, so a shard keeps its views as they are before.
    """
    cameras = read_cameras(job.inputs["priors"] / "cameras.parquet")
    plain = list(float_images(job.inputs["priors"]))
    background = empty_background(plain)
    if sharding.folders:
        shards = (load_painted(folder / "painted.safetensors") for folder in sharding.folders)
        views = [view for shard in shards for view in shard]
    else:
        views = _painted(job, sharding.select(cameras), background, progress)
    if sharding.is_shard:
        save_painted(out / "painted.safetensors", views)
        return
    painting, content = (
        read_rgb(job.inputs["style"] / "style.png"),
        replace_background(plain, background),
    )
    shown = restore_background(in_colors(views, content, painting, job.colors), plain, background)
    write_pictures(out, [camera.name for camera in cameras], iter(shown))


def _painted(
    job: ViewStylization,
    cameras: Sequence[Camera],
    background: EmptyBackground | None,
    progress: Progress,
) -> list[Image]:
    inputs, device = job.inputs, device_named(job.device_name)
    views = list(float_images(inputs["priors"], cameras))
    if "before" in inputs:
        views = blend_with_previous_round(views, cameras, inputs, device)
    content = replace_background(views, background)
    network = network_painter(inputs["network"], device) if "network" in inputs else None
    if network and not job.by_optimization:
        return painted(network, content, progress)
    config = with_style_parameters(configured(GatysConfig, job.settings), *job.factors)
    weights, style = inputs["perceptual"] / "vgg16.safetensors", inputs["style"]
    paint = optimizing_painter(weights, style / "style.png", config, device, network)
    return painted(paint, content, progress)
