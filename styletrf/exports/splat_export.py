"""Splats of a scene in all its styles, written, read back and compared with the field."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from safetensors.torch import save_file

from styletrf.capture.view_images import Image as ViewImage
from styletrf.evaluation.metrics import mean_squared_error
from styletrf.evaluation.quality import counted_pixels
from styletrf.exports.export_views import ExportViews, Look, stored_from_normalized
from styletrf.exports.splat_files import read_splats, storable_in_spz, write_splat_ply, write_spz
from styletrf.exports.splat_fit import Pictures, SplatFitConfig, fitted_splats
from styletrf.exports.splat_pictures import splat_picture
from styletrf.exports.splat_placement import placed_splats
from styletrf.exports.splats import Splats, moved_splats, splats_of_tensors, tensors_of
from styletrf.field.radiance_field import RadianceField
from styletrf.field.rendering import RenderConfig
from styletrf.files.images import from_integers
from styletrf.geometry.cameras import Camera
from styletrf.progress import Progress
from styletrf.psnr import bounded_psnr
from styletrf.trajectory.frames import rendered

MOST_SPLATS = 300_000


@dataclass(frozen=True, slots=True)
class HeldOut:
    """Photographs to measure by.

    Attributes:
        cameras: The cameras, in the normalized world.
        photographs: The photographs; pixels of alpha 0 do not count.
    """

    cameras: Sequence[Camera]
    photographs: Sequence[ViewImage]


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
        views: The views that splats are fitted to.
        looks: The names of looks and the loaders of their fields; that of the photographs first.
        held_out: The photographs to measure by.
        most: The most splats.
        progress: Called after every picture of a look, and after every iteration of the fit.

    Returns:
        The number of splats, the background, and the loss of each look in dB; a `note` if splats
        are too far away for `spz`, and so left out.

    Raises:
        InputError: There is no surface at all, or many splats are too far away for `spz`.
    """
    placed, stored_from = _placed(views, most), stored_from_normalized(views.model)
    notes = {}
    if file_format == "spz":
        near = storable_in_spz(moved_splats(placed, stored_from))
        if not near.all():
            left_out = f"{(~near).sum()} of {len(placed)} splats"
            notes["note"] = f"beyond the range of .spz, and so left out: {left_out}"
            placed = placed.chosen(near)
    splats, colors = fitted_splats(
        tensors_of(placed), _pictures(views, looks, progress), SplatFitConfig(), progress
    )
    stored = moved_splats(splats_of_tensors(splats), stored_from)
    write = {"ply": write_splat_ply, "spz": write_spz}[file_format]
    banks, measured = {}, {}
    for (name, load), bank in zip(looks, colors.split(3, dim=1), strict=True):
        path, field = out / f"{name}.{file_format}", load()
        write(path, stored, bank.numpy())
        banks[name] = (bank * 255).round().byte().contiguous()
        measured[name] = {
            "bytes": path.stat().st_size,
            "background": _background(field).tolist(),
            **_losses(path, field, views, held_out, is_photographs=field is views.field),
        }
    save_file(banks, out / "colors.safetensors")
    return {"splats": len(stored), "looks": measured, **notes}


def _placed(views: ExportViews, most: int) -> Splats:
    points = views.points()
    return placed_splats(points, views.to_grid(points.positions), views.field.resolution, most)


def _pictures(views: ExportViews, looks: Sequence[Look], progress: Progress) -> Pictures:
    """Returns the pictures of all looks by the views."""
    colors: list[list[torch.Tensor]] = [[] for _ in views.cameras]
    backgrounds = []
    for _, load in looks:
        field = load()
        backgrounds.append(_background(field))
        for of_view, picture in zip(colors, views.pictures(field, progress), strict=True):
            of_view.append(torch.from_numpy(picture))
    together = [torch.cat(of_view, dim=-1) for of_view in colors]
    return Pictures(views.cameras, together, torch.cat(backgrounds))


def _background(field: RadianceField) -> Float[torch.Tensor, " 3"]:
    return field.appearance.background_color().detach().float().cpu().clamp(0, 1)


def _losses(
    path: Path, field: RadianceField, views: ExportViews, held_out: HeldOut, *, is_photographs: bool
) -> dict[str, float]:
    """Returns PSNR in dB on the held-out views, of the file as it is read back.

    `psnr_to_field` against the field's pictures; of the photographs' look also both against the
    photographs.
    """
    splats, colors = read_splats(path)
    normalized_from_stored = np.linalg.inv(stored_from_normalized(views.model))
    tensors = tensors_of(moved_splats(splats, normalized_from_stored))
    background, bank = _background(field), torch.from_numpy(colors)
    renders = rendered(field, views.model.space, held_out.cameras, RenderConfig(), views.device)
    of_views: dict[str, list[float]] = {"psnr_to_field": [], "splats_psnr": [], "field_psnr": []}
    for camera, render, photograph in zip(
        held_out.cameras, renders, held_out.photographs, strict=True
    ):
        picture = splat_picture(tensors, bank, camera, background).clamp(0, 1).numpy()
        exact = render.color.numpy()
        reference = from_integers(np.ascontiguousarray(photograph[..., :3].numpy()))
        counts = counted_pixels(photograph)
        errors = {
            "psnr_to_field": mean_squared_error(picture, exact),
            "splats_psnr": mean_squared_error(picture, reference, counts),
            "field_psnr": mean_squared_error(exact, reference, counts),
        }
        for name, error in errors.items():
            of_views[name].append(bounded_psnr(error))
    if not is_photographs:
        of_views = {"psnr_to_field": of_views["psnr_to_field"]}
    return {name: float(np.mean(values)) for name, values in of_views.items() if values}
