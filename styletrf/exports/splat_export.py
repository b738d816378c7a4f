"""Splats of a scene in all its styles, written, read back and compared with the field."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from safetensors.torch import save_file

from styletrf.errors import InputError
from styletrf.exports.export_views import ExportViews, Look
from styletrf.exports.splat_files import read_splats, write_splat_ply, write_spz
from styletrf.exports.splat_fit import FitConfig, SeenSplats, fitted_colors, fitted_opacities, shown
from styletrf.exports.splat_footprints import footprints
from styletrf.exports.splat_placement import placed_splats
from styletrf.exports.splats import Splats, moved_splats
from styletrf.field.radiance_field import RadianceField
from styletrf.field.rendering import RenderConfig
from styletrf.geometry.cameras import Camera
from styletrf.progress import Progress
from styletrf.psnr import bounded_psnr
from styletrf.trajectory.frames import rendered

MOST_SPLATS = 300_000
_LOW_OPACITY = 0.7  # with which footprints are gathered: opacities may fall that far
_FIT_TERMINATION, _TERMINATION = 1e-3, 1e-4


@dataclass(frozen=True, slots=True)
class HeldOut:
    """Photographs to measure by.

    Attributes:
        cameras: In the normalized world.
        photographs: What they show, height x width x 3 each, in [0, 1].
    """

    cameras: Sequence[Camera]
    photographs: Sequence[np.ndarray]


def export_splats(
    out: Path,
    file_format: str,
    views: ExportViews,
    looks: Sequence[Look],
    held_out: HeldOut,
    most: int,
    progress: Progress,
) -> dict[str, Any]:
    """Writes `NAME.ply` or `NAME.spz` for each look, and `colors.safetensors`.

    All files have the same splats in the same order; `colors.safetensors` has the colors of all
    looks in 0 to 255.

    Args:
        out: The folder to fill.
        file_format: `ply` or `spz`.
        views: That splats are fitted to.
        looks: Names, and what loads the fields; that of the photographs first.
        held_out: To measure by.
        most: Splats.
        progress: Called after every look.

    Returns:
        How many splats there are, the background, and what each look loses, in dB.
    """
    config = FitConfig()
    splats, seen = _seen_splats(views, most)
    splats = Splats(
        splats.centers, splats.scales, splats.rotations,
        fitted_opacities(seen, _flat(views, views.field), config),
    )  # fmt: skip
    in_world = moved_splats(splats, np.linalg.inv(views.model.normalized_from_world))
    write = {"ply": write_splat_ply, "spz": write_spz}[file_format]
    banks, measured = {}, {}
    for number, (name, load) in enumerate(looks):
        field = load()
        opacities = splats.opacities.astype(np.float32)
        background = _background(field)
        seen = SeenSplats(seen.views, seen.n_splats, background)
        colors = fitted_colors(seen, _flat(views, field), opacities, config)
        path = out / f"{name}.{file_format}"
        write(path, in_world, colors)
        banks[name] = torch.from_numpy(np.round(colors * 255).astype(np.uint8))
        measured[name] = {
            "bytes": path.stat().st_size,
            "background": background.tolist(),
            **_losses(path, field, views, held_out, is_photographs=number == 0),
        }
        progress(number + 1, len(looks))
    save_file(banks, out / "colors.safetensors")
    return {"splats": len(splats), "looks": measured}


def _seen_splats(views: ExportViews, most: int) -> tuple[Splats, SeenSplats]:
    """Returns placed splats, and those as the views see them."""
    points = views.points()
    if not len(points):
        problem = "stops no ray of any photograph: there is nothing to make splats of"
        raise InputError("the field", problem, "Look at its frames, and fit it again")
    splats = placed_splats(points, views.to_grid(points.positions), views.field.resolution, most)
    low = Splats(
        splats.centers, splats.scales, splats.rotations, np.full(len(splats), _LOW_OPACITY)
    )
    of_views = [footprints(low, camera, _FIT_TERMINATION) for camera in views.cameras]
    return splats, SeenSplats(of_views, len(splats), _background(views.field))


def _flat(views: ExportViews, field: RadianceField) -> list[np.ndarray]:
    return [picture.reshape(-1, 3) for picture in views.pictures(field)]


def _background(field: RadianceField) -> Float[np.ndarray, " 3"]:
    color: Float[np.ndarray, " 3"] = field.appearance.background_color().detach().cpu().numpy()
    return color.clip(0, 1)


def _losses(
    path: Path, field: RadianceField, views: ExportViews, held_out: HeldOut, *, is_photographs: bool
) -> dict[str, float]:
    """Returns PSNR in dB on the held-out views, of the file as it is read back.

    `psnr_to_field` against the field's pictures; of the photographs' look also both against the
    photographs.
    """
    splats, colors = read_splats(path)
    splats = moved_splats(splats, views.model.normalized_from_world)
    opacities, background = splats.opacities.astype(np.float32), _background(field)
    space, config = views.model.space, RenderConfig()
    renders = rendered(field, space, held_out.cameras, config, views.device)
    of_views: dict[str, list[float]] = {"psnr_to_field": [], "splats_psnr": [], "field_psnr": []}
    for camera, render, photograph in zip(
        held_out.cameras, renders, held_out.photographs, strict=True
    ):
        view = footprints(splats, camera, _TERMINATION)
        picture = shown(view, opacities, colors, background).clip(0, 1)
        exact = render.color.numpy().reshape(-1, 3)
        of_views["psnr_to_field"].append(_psnr_db(picture, exact))
        of_views["splats_psnr"].append(_psnr_db(picture, photograph.reshape(-1, 3)))
        of_views["field_psnr"].append(_psnr_db(exact, photograph.reshape(-1, 3)))
    if not is_photographs:
        of_views = {"psnr_to_field": of_views["psnr_to_field"]}
    return {name: float(np.mean(values)) for name, values in of_views.items()}


def _psnr_db(a: np.ndarray, b: np.ndarray) -> float:
    return bounded_psnr(float(np.square(a.astype(np.float64) - b).mean()))
