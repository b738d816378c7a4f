"""How the frames of StylizedFrames come about: from one field, a mixture, or frame by frame."""

import functools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from styletrf.errors import InputError
from tasks.controls import FrameControls


@dataclass(frozen=True, slots=True)
class Mixture:
    """What of FrameControls says what is mixed where."""

    strength: float
    blend: Mapping[str, float]
    region: Mapping[str, Any]


def require_mixture(stage: FrameControls) -> None:
    """Refuses shares and regions that are none, and mixtures of what shares no density.

    Raises:
        InputError: With what to give instead.
    """
    shares = list(stage.blend.values())
    if not 0 <= stage.strength <= 1:
        told = f"--strength {stage.strength}"
        raise InputError(told, "is no share", "Give a number from 0 to 1")
    if not all(isinstance(s, float | int) and s > 0 for s in shares) or sum(shares) >= 1:
        told = f"--blend {dict(stage.blend)}"
        problem = "has shares that are none: each is above 0, and their sum below 1"
        raise InputError(told, problem, 'Give such as {"udnie": 0.3}')
    _require_region(stage.region)
    _require_of_frames(stage)
    mixed = stage.blend or stage.region or (stage.strength < 1 and stage.strategy != "s3")
    if mixed and (stage.method == "per-frame" or stage.strategy != "s3"):
        told = f"--method {stage.method} --strategy {stage.strategy}"
        problem = "has no density that several appearances share"
        raise InputError(told, problem, "Leave out --strength, --blend and --region")


def _require_of_frames(stage: FrameControls) -> None:
    """Refuses words about priors and fields where every frame is painted by itself."""
    if stage.method != "per-frame":
        return
    for name in ("colors", "strategy", "match", "rounds", "stylizer"):
        if not stage.is_usual(name):
            told = f"--method per-frame --{name} {getattr(stage, name)}"
            raise InputError(told, "paints frames without a field", f"Leave out --{name}")


def _require_region(region: Mapping[str, Any]) -> None:
    if region and not _is_box(region) and set(region) != {"view", "mask"}:
        raise InputError(
            f"--region {dict(region)}",
            "is no region",
            'Give {"box": [[x, y, z], [x, y, z]]} (least and greatest corner)'
            ' or {"view": "0003", "mask": "FILE.png"}',
        )
    if "mask" in region:
        _require_mask(region["mask"])


def _require_mask(mask: Any) -> None:
    if not (isinstance(mask, str) and Path(mask).is_file()):
        told = f"--region, mask {mask}"
        raise InputError(told, "there is no such file", "Give an image, white where styled")
    _read_mask(mask, Path(mask).stat().st_mtime_ns)


@functools.cache
def _read_mask(mask: str, _changed_ns: int) -> None:
    """Reads a mask whole, once for all stages of a command."""
    from styletrf.capture.photographs import read_photograph

    read_photograph(Path(mask))


def _is_box(region: Mapping[str, Any]) -> bool:
    corners = region.get("box")
    if set(region) != {"box"} or not isinstance(corners, list | tuple) or len(corners) != 2:
        return False
    are_points = all(
        isinstance(c, list | tuple) and len(c) == 3 and all(isinstance(v, int | float) for v in c)
        for c in corners
    )
    return are_points and all(a < b for a, b in zip(*corners, strict=True))


_FRAMES_FOR_COLORS, _SIDE_FOR_COLORS_PX = 12, 512


def frames_by_network(
    mixture: Mixture, inputs: Mapping[str, Path], cameras: Sequence[Any], device: Any,
    progress: Any,
) -> Iterator[Any]:  # fmt: skip
    """Yields every frame painted by itself, mixed with what it was by the strength.

    Frames get the painting's colors and contrast by one map for all, as painted priors do.
    """
    from styletrf.stylization.background import after_painting, before_painting, empty_ground
    from styletrf.stylization.color_transfer import recolored
    from styletrf.stylization.painters import each_painted, network_painter
    from styletrf.trajectory.frames import float_images

    ground = empty_ground(float_images(inputs["trajectory"]))
    plain, again = (float_images(inputs["trajectory"], cameras) for _ in range(2))
    content = (before_painting([view], ground)[0] for view in plain)
    paint = network_painter(inputs["network"], device)
    colors = _map_to_painting(inputs, paint, ground)
    views = each_painted(paint, content, len(cameras), progress)
    for image, before in zip(views, again, strict=True):
        (shown,) = after_painting([recolored(image, colors)], [before], ground)
        yield mixture.strength * shown + (1 - mixture.strength) * before.color


def _map_to_painting(inputs: Mapping[str, Path], paint: Any, ground: Any) -> Any:
    """Returns the map of colors of frames spread over the whole path, the same for each part."""
    import numpy as np

    from styletrf.files.images import read_rgb
    from styletrf.geometry.camera_table import read_cameras
    from styletrf.stylization.background import before_painting
    from styletrf.stylization.color_transfer import map_to_painting
    from styletrf.stylization.painters import each_painted
    from styletrf.trajectory.frames import float_images

    path = read_cameras(inputs["trajectory"] / "cameras.parquet")
    chosen = np.unique(np.linspace(0, len(path) - 1, _FRAMES_FOR_COLORS).round().astype(int))
    views = float_images(inputs["trajectory"], [path[k] for k in chosen])
    content = (before_painting([view], ground)[0] for view in views)
    step = math.ceil(max(path[0].width, path[0].height) / _SIDE_FOR_COLORS_PX)
    painted = each_painted(paint, content, len(chosen))
    shown = [image[::step, ::step].copy() for image in painted]
    return map_to_painting(shown, read_rgb(inputs["style"] / "style.png"))


def frames_of_field(
    mixture: Mixture, inputs: Mapping[str, Path], cameras: Sequence[Any], render: Any,
    device: Any, progress: Any, depths: Path | None = None,
) -> Iterator[Any]:  # fmt: skip
    """Yields the frames of the stylised field, or of the mixture that is asked for.

    Writes `NAME.exr` with their depth into the folder `depths`, where one is given.
    """
    from styletrf.field.radiance_field import load_stylized_field
    from styletrf.files.float_images import write_float_image
    from styletrf.scene.scene_model import read_scene_model
    from styletrf.trajectory.frames import rendered

    space = read_scene_model(inputs["model"] / "scene.json").space
    field = load_stylized_field(inputs["field"], inputs["stylized"])
    mixed = None
    if mixture.blend or mixture.region or mixture.strength < 1:
        mixed = _mixed(mixture, inputs, field, space)
    shown = rendered(field, space, cameras, render, device, progress, mixed)
    for camera, view in zip(cameras, shown, strict=True):
        color, opacity, depth = (p.numpy() for p in (view.color, view.opacity, view.depth))
        if depths is not None:
            write_float_image(depths / f"{camera.name}.exr", color, opacity, depth)
        yield color


def _mixed(mixture: Mixture, inputs: Mapping[str, Path], field: Any, space: Any) -> Any:
    """Returns photograph, style and the others by their shares."""
    from styletrf.field.radiance_field import load_field
    from styletrf.stylization.mixed_appearance import MixedAppearance

    others = [load_field(inputs["field"], inputs[f"blend {style}"]) for style in mixture.blend]
    shares = [mixture.strength * share for share in mixture.blend.values()]
    shares = [1 - mixture.strength, mixture.strength - sum(shares), *shares]
    appearances = [f.appearance for f in (load_field(inputs["field"]), field, *others)]
    return MixedAppearance(
        appearances, shares, _region(mixture, inputs), space.within(field.bounds)
    )


def _region(mixture: Mixture, inputs: Mapping[str, Path]) -> Any:
    from styletrf.stylization.region import Box, masked_on

    if "box" in mixture.region:
        corners = [[float(value) for value in corner] for corner in mixture.region["box"]]
        (x, y, z), (far_x, far_y, far_z) = corners
        return Box((x, y, z), (far_x, far_y, far_z))
    if "view" in mixture.region:
        return masked_on(inputs["priors"], mixture.region["view"], Path(mixture.region["mask"]))
    return None
