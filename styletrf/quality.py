"""How well a field shows the views it was not fitted to."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from styletrf.cameras import Camera
from styletrf.field import RadianceField
from styletrf.frames import rendered
from styletrf.images import from_integers, write_rgb
from styletrf.metrics import psnr, ssim
from styletrf.progress import Progress, silent
from styletrf.rendering import RenderConfig
from styletrf.space import Space


@dataclass(frozen=True, slots=True)
class ViewQuality:
    """One held-out view: PSNR in dB and SSIM against its photograph."""

    view: str
    psnr: float
    ssim: float


def measure_quality(
    radiance: RadianceField,
    space: Space,
    cameras: Sequence[Camera],
    photographs: UInt8[Tensor, "views height width 3"],
    config: RenderConfig,
    device: torch.device,
    picture_folder: Path,
    progress: Progress = silent,
) -> tuple[list[ViewQuality], dict[str, float]]:
    """Returns the quality of each view and the means; writes each render beside its photograph."""
    rows = []
    renders = rendered(radiance, space, cameras, config, device, progress)
    for camera, render, photograph in zip(cameras, renders, photographs, strict=True):
        image, reference = render.color.numpy(), from_integers(photograph.numpy())
        rows.append(ViewQuality(camera.name, psnr(image, reference), ssim(image, reference)))
        write_rgb(picture_folder / f"{camera.name}.png", np.concatenate([image, reference], axis=1))
    means = {
        "psnr": float(np.mean([row.psnr for row in rows])),
        "ssim": float(np.mean([row.ssim for row in rows])),
        "views": float(len(rows)),
    }
    return rows, means
