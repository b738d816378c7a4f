"""Painters of views: a style network, or an optimization of each view."""

import logging
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from safetensors.numpy import load_file, save_file
from torch import Tensor

from styletrf.errors import NotFiniteError
from styletrf.files.images import read_rgb
from styletrf.progress import Progress, silent
from styletrf.style.gatys import GatysConfig, paint_by_optimization
from styletrf.style.perceptual.painting_size import scale_warnings
from styletrf.style.perceptual.vgg import load_vgg
from styletrf.style.style_network import load_style_network, stylize

Image = Float[np.ndarray, "height width 3"]
Painter = Callable[[Tensor], Tensor]
_LOGGER = logging.getLogger(__name__)


def network_painter(folder: Path, device: torch.device) -> Painter:
    """Returns a function that stylizes an image by the network in a folder."""
    network = load_style_network(folder, device)
    return lambda image: stylize(network, image.to(device)).cpu()


def optimizing_painter(
    weights: Path,
    style: Path,
    config: GatysConfig,
    device: torch.device,
    network: Painter | None = None,
) -> Painter:
    """Returns a function that stylizes an image by optimizing its pixels.

    Args:
        weights: The weights of the perceptual network.
        style: The painting.
        config: The settings; with the start `network`, `network` must be given.
        device: The device that computes.
        network: Paints the picture that an optimization starts from.
    """
    vgg, painting = load_vgg(weights, device), torch.from_numpy(read_rgb(style)).to(device)
    for warning in scale_warnings(painting.shape, config.style_px, config.stroke_scale):
        _LOGGER.warning(warning)
    paint = partial(paint_by_optimization, vgg, style=painting, config=config)

    def painter(image: Tensor) -> Tensor:
        begin = network(image).to(device) if network else None
        return paint(content=image.to(device), begin=begin).cpu()

    return painter


def save_painted(path: Path, views: Sequence[Image]) -> None:
    """Writes painted views without rounding."""
    save_file({f"{k:06d}": np.ascontiguousarray(view) for k, view in enumerate(views)}, path)


def load_painted(path: Path) -> list[Image]:
    """Returns the views that `save_painted` wrote, in order."""
    return [view for _, view in sorted(load_file(path).items())]


def painted(
    paint: Painter, names: Sequence[str], views: Sequence[Image], progress: Progress = silent
) -> list[Image]:
    """Returns all views painted; see `each_painted`."""
    return list(each_painted(paint, names, iter(views), progress))


def each_painted(
    paint: Painter, names: Sequence[str], views: Iterator[Image], progress: Progress = silent
) -> Iterator[Image]:
    """Yields the views painted, one at a time.

    Args:
        paint: Paints a view.
        names: The names of the views, by which an error names one.
        views: RGB in [0, 1], as many.
        progress: Called with the number of views.

    Raises:
        NotFiniteError: A view is not finite; the error names it.
    """
    for k, (name, view) in enumerate(zip(names, views, strict=True)):
        try:
            yield paint(torch.from_numpy(view)).numpy()
        except NotFiniteError as error:
            raise NotFiniteError(error.stage, error.tensor, f"in view {name}") from error
        progress(k + 1, len(names))
