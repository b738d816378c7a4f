"""Warnings about paintings that stylize poorly, before hours are spent on them."""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.style.perceptual.perceptual_loss import gram_matrix
from styletrf.style.perceptual.vgg import VGG16

FINE_LAYER = "relu1_2"
_SMALL_PX = 256
_FAINT_DEVIATION = 0.05  # of colors, on [0, 1]
_ONE_HUE = 0.005  # variance across the main axis of color, as a fraction of that along it
_UNSTEADY_TRACE = 2.0  # times the photographs'


def painting_warnings(image: Float[np.ndarray, "height width 3"]) -> list[str]:
    """Returns warnings about a painting, RGB in [0, 1], by its size and colors."""
    warnings = []
    short = min(image.shape[:2])
    if short < _SMALL_PX:
        warnings.append(
            f"the painting has only {short} pixels on its shorter side: expect coarse strokes"
            f" without texture; {_SMALL_PX} or more show the brush"
        )
    variances = np.linalg.eigvalsh(np.cov(image.reshape(-1, 3).astype(np.float64), rowvar=False))
    if np.sqrt(variances.sum()) < _FAINT_DEVIATION:
        warnings.append("the painting has hardly any contrast: expect a wash of one color")
    elif variances[1] < _ONE_HUE * variances[2]:
        warnings.append(
            "the painting's colors lie on one line, such as grays or one hue: expect a scene in"
            " these alone; --colors photograph or luminance keeps the scene's"
        )
    return warnings


@torch.no_grad()
def gram_trace_ratio(
    vgg: VGG16, style: Float[Tensor, "1 3 _ _"], content: Float[Tensor, "batch 3 _ _"]
) -> float:
    """Returns the trace of the painting's Gram matrix of relu1_2 over that of photographs.

    The larger the trace, the less steady a network (Gupta et al. 2017, arXiv 1705.02092).
    """
    traces = [
        torch.diagonal(gram_matrix(vgg.features(i, [FINE_LAYER])[FINE_LAYER]), dim1=1, dim2=2)
        .sum(dim=1)
        .mean()
        for i in (style, content)
    ]
    return float(traces[0] / traces[1].clamp(min=torch.finfo(torch.float32).tiny))


def trace_warnings(ratio: float) -> list[str]:
    """Returns warnings about a painting by its fine Gram trace."""
    if ratio < _UNSTEADY_TRACE:
        return []
    return [
        f"the painting's fine Gram trace is {ratio:.1f} times that of photographs: expect strokes"
        " that differ from view to view; a higher temporal_loss.weight of StyleNetwork, or a larger"
        " --stroke-scale, calms them"
    ]
