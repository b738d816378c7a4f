"""Masks of photographs: which of their pixels count, where people walk through or a hand holds.

A mask is a PNG as large as its upright photograph, black where the photograph does not count. That
of `images/walk/1.jpg` is `masks/walk/1.png` or `masks/walk/1.jpg.png`, beside `images` or in it.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Bool

from styletrf.capture.photographs import read_photograph
from styletrf.errors import InputError

MASKS = "masks"


def find_masks(photographs: Path, files: Sequence[Path]) -> dict[Path, Path]:
    """Returns the masks that there are, by their photographs.

    Args:
        photographs: The folder of the photographs.
        files: The photographs in it.
    """
    folders = [photographs.parent / MASKS, photographs / MASKS]
    found = {}
    for file in files:
        name = (
            file.relative_to(photographs) if file.is_relative_to(photographs) else Path(file.name)
        )
        names = [name.with_suffix(".png"), name.with_name(f"{name.name}.png")]
        masks = [mask for folder in folders for n in names if (mask := folder / n).is_file()]
        if masks:
            found[file] = masks[0]
    return found


def read_mask(path: Path) -> Bool[np.ndarray, "height width"]:
    """Returns which pixels count: those that are nearer to white than to black.

    Raises:
        InputError: The file is no image.
    """
    counts: Bool[np.ndarray, "height width"] = read_photograph(path).mean(axis=2) > 127
    return counts


def mask_of_view(images: Path, name: str) -> Bool[np.ndarray, "height width"] | None:
    """Returns which pixels of a view count; None where all do.

    Args:
        images: The folder of the views, beside which that of their masks lies.
        name: Of the view.
    """
    mask = images.parent / MASKS / f"{name}.png"
    return read_mask(mask) if mask.exists() else None


def require_mask_of(path: Path, width: int, height: int) -> None:
    """Refuses what is no mask of a photograph of that size.

    Raises:
        InputError: It is no image, of another size, or black all over.
    """
    mask = read_mask(path)
    if mask.shape != (height, width):
        problem = f"is {mask.shape[1]}x{mask.shape[0]}, and its photograph {width}x{height}"
        raise InputError(f"mask {path.name}", problem, "Draw it at the photograph's size")
    if not mask.any():
        remedy = "Leave the photograph out, or make white what counts"
        raise InputError(f"mask {path.name}", "is black all over", remedy)
