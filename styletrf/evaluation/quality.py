"""Measures how well a field renders the views that it was not fitted to."""

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool

from styletrf.capture.view_images import Image as ViewImage
from styletrf.configuration import require_at_least
from styletrf.errors import InputError
from styletrf.evaluation.exposed_image import psnr_exposed
from styletrf.evaluation.lpips_distance import lpips_metric
from styletrf.evaluation.metrics import Image, mean_squared_error, psnr, ssim
from styletrf.evaluation.perceptual_distance import PerceptualFeatures
from styletrf.field.rendering import RenderConfig, Rendering
from styletrf.files.frame_limits import SMALLEST_PX
from styletrf.files.images import from_integers, write_rgb
from styletrf.finiteness import require_finite
from styletrf.geometry.cameras import Camera
from styletrf.psnr import psnr_of_error
from styletrf.style.perceptual.vgg import REDUCTION, load_vgg

_LOGGER = logging.getLogger(__name__)
ImageMetric = Callable[[Image, Image], float]
"""A measure of an image against its reference."""


@dataclass(frozen=True, slots=True)
class QualityConfig:
    """Settings of the rendering and measuring of views.

    Attributes:
        render: The settings of the render.
        long_side_px: The longer side of the views compared, as of frames at least 64; 0 for the
            scene's working size. Values compare at one size only.
        perceptual_px: The longer side at which views go through the perceptual network.
        lpips: Whether LPIPS is measured as well, see `styletrf.evaluation.lpips_distance`.
        aligned: Whether PSNR is measured with aligned cameras as well, see
            `styletrf.evaluation.alignment.held_out_alignment`.
    """

    render: RenderConfig = field(default_factory=RenderConfig)
    long_side_px: int = 0
    perceptual_px: int = 504
    lpips: bool = False
    aligned: bool = False

    def __post_init__(self) -> None:
        require_at_least(REDUCTION, self, "perceptual_px")
        if self.long_side_px:
            require_at_least(SMALLEST_PX, self, "long_side_px")


def requested_metrics(
    config: QualityConfig, weights: Path, device: torch.device
) -> dict[str, ImageMetric]:
    """Returns the metrics by the column of their figures.

    `psnr` in dB, `ssim`, `perceptual` (by the VGG16 of `weights`), and `lpips` if required.

    Raises:
        InputError: The weights cannot be read; or LPIPS is required and not installed.
    """
    perception = PerceptualFeatures(load_vgg(weights, device), config.perceptual_px)
    metrics: dict[str, ImageMetric] = {
        "psnr": psnr,
        "ssim": ssim,
        "perceptual": perception.distance,
    }
    return metrics | ({"lpips": lpips_metric(device)} if config.lpips else {})


def measure_quality(
    renders: Iterable[Rendering],
    cameras: Sequence[Camera],
    photographs: Iterable[ViewImage],
    metrics: Mapping[str, ImageMetric],
    picture_folder: Path,
) -> tuple[list[dict[str, Any]], dict[str, float]]:
    """Returns a row of every metric's figure for each view, and the means.

    Writes each render beside its photograph as `NAME.png`. Pixels of alpha 0 do not count for
    either PSNR; other metrics see the photograph there.

    Raises:
        InputError: There is no view.
        NotFiniteError: A render or a figure is not finite, but for the infinite PSNR of equal
            pictures.
    """
    if not cameras:
        problem = "are covered by their masks, or there are none: nothing can be measured"
        raise InputError("the held-out views", problem, "Make white in the masks what counts")
    rows: list[dict[str, Any]] = []
    for camera, render, photograph in zip(cameras, renders, photographs, strict=True):
        reference = from_integers(np.ascontiguousarray(photograph[..., :3].numpy()))
        image, counts = render.color.numpy(), counted_pixels(photograph)
        shown = np.where(counts[..., None], image, reference)
        figures = {name: metric(shown, reference) for name, metric in metrics.items()}
        if "psnr" in figures:
            figures["psnr"] = psnr_of_error(mean_squared_error(image, reference, counts))
        if "psnr_exposed" in figures:
            figures["psnr_exposed"] = psnr_exposed(image, reference, counts)
        finite = [(name, np.array(value)) for name, value in figures.items() if value != np.inf]
        require_finite("quality", f"in view {camera.name}", [("render", image), *finite])
        rows.append({"view": camera.name} | figures)
        write_rgb(picture_folder / f"{camera.name}.png", np.concatenate([image, reference], axis=1))
    means = {name: float(np.mean([row[name] for row in rows])) for name in metrics}
    return rows, means | {"views": float(len(rows))}


def views_that_count(
    cameras: Sequence[Camera], photographs: Sequence[ViewImage]
) -> tuple[list[Camera], list[ViewImage]]:
    """Returns the views that have a pixel that counts, and warns of the others."""
    kept = [k for k, image in enumerate(photographs) if counted_pixels(image).any()]
    if left_out := [camera.name for k, camera in enumerate(cameras) if k not in kept]:
        _LOGGER.warning(
            "held-out views that their masks cover completely are not measured: %s",
            ", ".join(left_out),
        )
    return [cameras[k] for k in kept], [photographs[k] for k in kept]


def counted_pixels(photograph: ViewImage) -> Bool[np.ndarray, "height width"]:
    """Returns which pixels of a photograph count, by its alpha where it has one."""
    whole = torch.ones(photograph.shape[:2], dtype=torch.bool)
    counts: Bool[np.ndarray, "height width"] = (
        photograph[..., 3].cpu() > 0 if photograph.shape[2] == 4 else whole
    ).numpy()
    return counts
