"""Renders a field along a path: float images with depth, or pictures and a video."""

import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, UInt8

from styletrf.errors import InputError
from styletrf.field.appearance import ColorModel
from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField
from styletrf.field.rendering import RenderConfig, Rendering, render_view
from styletrf.field.view_rays import ViewRays
from styletrf.files.float_images import FloatImage, read_float_image, write_float_image
from styletrf.files.frame_limits import DEFAULT_RATE, require_frame_limits
from styletrf.files.images import to_integers, write_rgb
from styletrf.files.video import write_video
from styletrf.finiteness import first_not_finite, parameter_stages, require_finite
from styletrf.geometry.camera_table import read_cameras, write_cameras
from styletrf.geometry.cameras import Camera
from styletrf.geometry.space import Space
from styletrf.progress import Progress, silent
from styletrf.trajectory.support_config import SupportConfig
from styletrf.trajectory.trajectory_config import TrajectoryConfig


@dataclass(frozen=True, slots=True)
class FramesConfig:
    """The path that is rendered, and how.

    A `long_side_px` of 0 is the scene's working size. Unless `enlarged`, frames are no larger than
    the photographs.
    """

    long_side_px: int = 0
    enlarged: bool = True
    trajectory: TrajectoryConfig = field(default_factory=TrajectoryConfig)
    support: SupportConfig = field(default_factory=SupportConfig)
    render: RenderConfig = field(default_factory=RenderConfig)
    frames_per_second: int = DEFAULT_RATE

    def __post_init__(self) -> None:
        require_frame_limits(self.long_side_px, self.frames_per_second)


def rendered(
    radiance: RadianceField,
    space: Space,
    cameras: Sequence[Camera],
    config: RenderConfig,
    device: torch.device,
    progress: Progress = silent,
    appearance: ColorModel | None = None,
) -> Iterator[Rendering]:
    """Yields the render of each camera, on the CPU; an `appearance` replaces the field's own.

    Raises:
        NotFiniteError: A render is not finite; the error names the view, and the camera or the
            parameter if that is not. Infinite depth is where nothing is hit.
    """
    if not cameras:
        return
    radiance = radiance.to(device)
    appearance = None if appearance is None else appearance.to(device)
    rays = ViewRays(cameras, space.within(radiance.bounds), radiance.step_length, device)
    for k, camera in enumerate(cameras):
        render = render_view(radiance, kernels_for(device), rays, k, camera, config, appearance)
        progress(k + 1, len(cameras))
        render = Rendering(*(getattr(render, name).cpu() for name in render.__slots__))
        _require_finite(render, camera, radiance, appearance or radiance.appearance)
        yield render


def _require_finite(
    render: Rendering, camera: Camera, radiance: RadianceField, appearance: ColorModel
) -> None:
    outputs = [("color", render.color), ("opacity", render.opacity)]
    for name, depth in (("depth", render.depth), ("median depth", render.median_depth)):
        outputs.append((name, depth.masked_fill(depth == torch.inf, 0.0)))
    if first_not_finite(outputs):
        causes = parameter_stages(radiance.density), parameter_stages(appearance)
        require_finite("rendering", f"in view {camera.name}", chain(*causes, outputs))


def write_float_frames(
    folder: Path,
    cameras: Sequence[Camera],
    renders: Iterator[Rendering],
    path: Sequence[Camera] | None = None,
) -> None:
    """Writes `frames/NAME.exr` (R G B A half, Z float, the surface depth) and `cameras.parquet`.

    Args:
        folder: The folder to fill.
        cameras: The cameras of the renders.
        renders: One render for each camera.
        path: The cameras of the table, of which those of the renders are a part; else the same.
    """
    (folder / "frames").mkdir()
    for camera, render in zip(cameras, renders, strict=True):
        write_float_image(
            folder / "frames" / f"{camera.name}.exr",
            render.color.numpy(), render.opacity.numpy(), render.surface_depth.numpy(),
        )  # fmt: skip
    write_cameras(folder / "cameras.parquet", cameras if path is None else path)


def join_float_frames(parts: Sequence[Path], folder: Path) -> None:
    """Joins parts along one path to the files that `write_float_frames` of all frames would write.

    Raises:
        InputError: The parts are of different paths: their machines came to different views.
    """
    tables = {(part / "cameras.parquet").read_bytes() for part in parts}
    if len(tables) > 1:
        problem = "are not of one path: the machines that made them chose different views"
        raise InputError("the parts", problem, "Make them with --shards 1, or on one kind of them")
    join_pictures(parts, folder)
    for file in (path for path in parts[0].iterdir() if path.is_file()):
        shutil.copyfile(file, folder / file.name)


def join_pictures(parts: Sequence[Path], folder: Path) -> None:
    """Copies the `frames/` of all parts, and their other folders."""
    for file in chain.from_iterable(part.glob("*/*") for part in parts):
        (folder / file.parent.name).mkdir(exist_ok=True)
        shutil.copyfile(file, folder / file.parent.name / file.name)


def float_images(folder: Path, cameras: Sequence[Camera] | None = None) -> Iterator[FloatImage]:
    """Yields the frames that `write_float_frames` wrote, in order.

    Where some cameras are given, only their frames.
    """
    for camera in read_cameras(folder / "cameras.parquet") if cameras is None else cameras:
        yield read_float_image(folder / "frames" / f"{camera.name}.exr")


def float_frames(
    folder: Path, cameras: Sequence[Camera] | None = None
) -> Iterator[Float[np.ndarray, "height width 3"]]:
    """Yields the colors of `float_images`."""
    return (image.color for image in float_images(folder, cameras))


def write_pictures(
    folder: Path, names: Sequence[str], images: Iterator[Float[np.ndarray, "height width 3"]]
) -> None:
    """Writes `frames/NAME.png`."""
    (folder / "frames").mkdir()
    for name, image in zip(names, images, strict=True):
        write_rgb(folder / "frames" / f"{name}.png", image)


def write_clip(
    path: Path,
    images: Iterator[Float[np.ndarray, "height width 3"]],
    frames_per_second: float | int,
) -> None:
    """Writes frames in [0, 1] as a video that browsers play."""
    pictures: Iterator[UInt8[np.ndarray, "height width 3"]] = (to_integers(i) for i in images)
    write_video(path, pictures, frames_per_second)
