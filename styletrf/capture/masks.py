"""Masks of photographs: which of their pixels count, for example where people walk through.

A mask is a PNG as large as its upright photograph, black where the photograph does not count.
Its transparent parts are black, too: on an empty layer, only pixels painted white count.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Bool, UInt8

from styletrf.capture.photographs import read_photograph
from styletrf.errors import InputError

MASKS = "masks"


def read_mask(path: Path) -> Bool[np.ndarray, "height width"]:
    """Returns which pixels of a photograph count by its mask.

    Raises:
        InputError: The file is no image.
    """
    return counted_pixels(read_mask_image(path))


def read_mask_image(path: Path) -> UInt8[np.ndarray, "height width 3"]:
    """Returns the RGB pixels of a mask, transparent parts over black.

    Raises:
        InputError: The file is no image.
    """
    return read_photograph(path, ground=0.0)


def counted_pixels(mask: UInt8[np.ndarray, "height width 3"]) -> Bool[np.ndarray, "height width"]:
    """Returns which pixels of a mask count: those that are nearer to white than to black."""
    counts: Bool[np.ndarray, "height width"] = mask.mean(axis=2) > 127
    return counts


def mask_of_view(images: Path, name: str) -> Bool[np.ndarray, "height width"] | None:
    """Returns which pixels of a view count; None where all do.

    Args:
        images: The folder of the views, beside which that of their masks lies.
        name: The name of the view.
    """
    mask = images.parent / MASKS / f"{name}.png"
    return read_mask(mask) if mask.exists() else None


def require_mask_of(path: Path, width: int, height: int) -> None:
    """Refuses a file that is not a mask of a photograph of that size.

    Raises:
        InputError: It is no image, of another size, or black all over.
    """
    mask = read_mask(path)
    if mask.shape != (height, width):
        problem = f"is {mask.shape[1]}x{mask.shape[0]}, and its photograph {width}x{height}"
        raise InputError(f"mask {path.name}", problem, "Draw it at the photograph's size")
    if not mask.any():
        image = read_mask_image(path)
        brightest = int(image.max())
        remedy = "Leave the photograph out, or make white what counts"
        if (read_photograph(path) != image).any():  # on white, so that transparent parts show
            remedy = "Put a white layer beneath the paint, or paint white what counts"
        elif brightest:
            remedy = f"Make what counts white (255): its brightest pixel is {brightest}"
        problem = "is black all over, or nearly so; transparent parts are black"
        raise InputError(f"mask {path.name}", problem, remedy)
