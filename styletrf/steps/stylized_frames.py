"""The frames of the stylized fly-through: from one field, from a blend of styles, or one by one."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.evaluation.consistency.frame_pairs import OWN_DEPTHS
from styletrf.even_spread import evenly_spread
from styletrf.field.radiance_field import RadianceField, load_field, load_stylized_field
from styletrf.field.rendering import RenderConfig
from styletrf.files.float_images import write_float_image
from styletrf.files.images import read_rgb
from styletrf.files.video_frames import video_info
from styletrf.geometry.camera_table import read_cameras, write_cameras
from styletrf.geometry.cameras import Camera
from styletrf.geometry.space import Space
from styletrf.progress import Progress, silent
from styletrf.scene.scene_model import read_scene_model
from styletrf.steps.sharding import shard_folders, shard_of
from styletrf.steps.step_run import StepRun
from styletrf.stylization.background import (
    EmptyBackground,
    empty_background,
    replace_background,
    restore_background,
)
from styletrf.stylization.color_transfer import ColorMap, map_to_painting, recolored
from styletrf.stylization.mixed_appearance import MixedAppearance
from styletrf.stylization.painters import Painter, each_painted, network_painter
from styletrf.stylization.region import Box, Region, masked_on
from styletrf.trajectory.frames import (
    float_images,
    join_pictures,
    rendered,
    write_clip,
    write_pictures,
)

_FRAMES_FOR_COLORS, _SIDE_FOR_COLORS_PX = 12, 512


@dataclass(frozen=True, slots=True)
class Blend:
    """Which styles are blended where.

    Attributes:
        strength: The weight of all styles against the photographs' appearance, in [0, 1].
        weights: The weights of other styles; the main style has the rest.
        region: A box or a mask on a prior, to which the style is confined; empty for everywhere.
    """

    strength: float
    weights: Mapping[str, float]
    region: Mapping[str, Any]

    @property
    def is_plain(self) -> bool:
        """Whether only the main style is rendered, everywhere."""
        return not self.weights and not self.region and self.strength == 1


def render_stylized(
    inputs: Mapping[str, Path],
    out: Path,
    settings: Mapping[str, Any],
    run: StepRun,
    *,
    blend: Blend,
    writes_depths: bool,
) -> None:
    """Writes `frames/NAME.png` and `video.mp4`; a shard leaves `cameras.parquet` and no video.

    Args:
        inputs: `trajectory`; `field`, `model` and `stylized` for frames of a field, or `network`
            and `style` for frames that are stylized independently (without `style` they keep the
            network's colors); `blend NAME` of other styles; `priors` for a mask; or `trajectory`
            and the shards to join.
        out: The folder to fill.
        settings: Those of `RenderConfig`.
        run: Its progress is the number of frames.
        blend: Which styles are blended where.
        writes_depths: Whether the depth of the frames is written beside them.
    """
    cameras = read_cameras(inputs["trajectory"] / "cameras.parquet")
    shown = shard_of(cameras, run.shard)
    if shards := shard_folders(inputs):
        join_pictures(shards, out)
    else:
        depths = _depths_folder(out) if writes_depths else None
        device_name, progress = run.device_name, run.progress
        frames = stylized_frames(inputs, shown, settings, blend, device_name, progress, depths)
        write_pictures(out, [camera.name for camera in shown], frames)
    if run.shard:
        write_cameras(out / "cameras.parquet", shown)
        return
    images = (read_rgb(out / "frames" / f"{camera.name}.png") for camera in cameras)
    rate = video_info(inputs["trajectory"] / "video.mp4").frames_per_second
    write_clip(out / "video.mp4", images, rate)


def stylized_frames(
    inputs: Mapping[str, Path],
    cameras: Sequence[Camera],
    settings: Mapping[str, Any],
    blend: Blend,
    device_name: str,
    progress: Progress = silent,
    depths: Path | None = None,
) -> Iterator[Any]:
    """Yields the frames that cameras of the trajectory see, in RGB.

    Args:
        inputs: Those of `render_stylized`.
        cameras: Some of the trajectory's.
        settings: Those of `RenderConfig`.
        blend: Which styles are blended where.
        device_name: `auto`, `cpu` or `cuda`.
        progress: Called with the number of frames.
        depths: A folder for the depths of the field, `NAME.exr`; without it they are not written.
    """
    device = device_named(device_name)
    if "network" in inputs:
        return _frames_by_network(blend, inputs, cameras, device, progress)
    config = configured(RenderConfig, settings)
    return _frames_of_field(blend, inputs, cameras, config, device, progress, depths)


def _depths_folder(out: Path) -> Path:
    folder = out / OWN_DEPTHS
    folder.mkdir()
    return folder


def _frames_by_network(
    blend: Blend, inputs: Mapping[str, Path], cameras: Sequence[Camera], device: torch.device,
    progress: Progress,
) -> Iterator[Any]:  # fmt: skip
    """Yields every frame, stylized independently and blended with the unstylized one by strength.

    One color map for all frames transfers the painting's colors and contrast, as for the priors,
    if the painting is given.
    """
    background = empty_background(float_images(inputs["trajectory"]))
    plain, again = (float_images(inputs["trajectory"], cameras) for _ in range(2))
    content = (replace_background([view], background)[0] for view in plain)
    paint = network_painter(inputs["network"], device)
    colors = _map_to_painting(inputs, paint, background) if "style" in inputs else None
    views = each_painted(paint, [camera.name for camera in cameras], content, progress)
    for image, before in zip(views, again, strict=True):
        painted = image if colors is None else recolored(image, colors)
        (shown,) = restore_background([painted], [before], background)
        yield blend.strength * shown + (1 - blend.strength) * before.color


def _map_to_painting(
    inputs: Mapping[str, Path], paint: Painter, background: EmptyBackground | None
) -> ColorMap:
    """Returns the color map of frames spread over the whole path, the same for every shard."""
    path = read_cameras(inputs["trajectory"] / "cameras.parquet")
    chosen = evenly_spread(path, _FRAMES_FOR_COLORS)
    views = float_images(inputs["trajectory"], chosen)
    content = (replace_background([view], background)[0] for view in views)
    step = math.ceil(max(path[0].width, path[0].height) / _SIDE_FOR_COLORS_PX)
    painted = each_painted(paint, [camera.name for camera in chosen], content)
    shown = [image[::step, ::step].copy() for image in painted]
    again = float_images(inputs["trajectory"], chosen) if background else ()
    opacities = [view.opacity[::step, ::step].copy() for view in again] or None
    return map_to_painting(shown, read_rgb(inputs["style"] / "style.png"), opacities)


def _frames_of_field(
    blend: Blend, inputs: Mapping[str, Path], cameras: Sequence[Camera], config: RenderConfig,
    device: torch.device, progress: Progress, depths: Path | None,
) -> Iterator[Any]:  # fmt: skip
    """Yields the frames of the stylized field, or of a blend; writes `depths/NAME.exr`."""
    space = read_scene_model(inputs["model"] / "scene.json").space
    field = load_stylized_field(inputs["field"], inputs["stylized"])
    blended = None if blend.is_plain else _blended(blend, inputs, field, space)
    views = rendered(field, space, cameras, config, device, progress, blended)
    for camera, view in zip(cameras, views, strict=True):
        color, opacity, depth = (p.numpy() for p in (view.color, view.opacity, view.surface_depth))
        if depths is not None:
            write_float_image(depths / f"{camera.name}.exr", color, opacity, depth)
        yield color


def _blended(
    blend: Blend, inputs: Mapping[str, Path], field: RadianceField, space: Space
) -> MixedAppearance:
    """Returns the weighted blend of the photographs' appearance, the style and the other styles."""
    others = [load_field(inputs["field"], inputs[f"blend {style}"]) for style in blend.weights]
    weights = [blend.strength * weight for weight in blend.weights.values()]
    weights = [1 - blend.strength, blend.strength - sum(weights), *weights]
    appearances = [f.appearance for f in (load_field(inputs["field"]), field, *others)]
    return MixedAppearance(appearances, weights, _region(blend, inputs), space.within(field.bounds))


def _region(blend: Blend, inputs: Mapping[str, Path]) -> Region | None:
    if "box" in blend.region:
        corners = [[float(value) for value in corner] for corner in blend.region["box"]]
        (x, y, z), (far_x, far_y, far_z) = corners
        return Box((x, y, z), (far_x, far_y, far_z))
    if "view" in blend.region:
        return masked_on(inputs["priors"], blend.region["view"], Path(blend.region["mask"]))
    return None
