"""Unrounded renders of a field: OpenEXR files with the channels R G B, A and Z.

Any compositing program opens these files. Z is always 32 bits, the rest 16 (half) or 32.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR
from jaxtyping import Float

from styletrf.errors import InputError
from styletrf.files.atomic_write import atomic_write

_COLOR_CHANNELS = ("R", "G", "B")
_COMMENTS = (
    "R G B: in the encoding of sRGB, not linear, and blended with the background. "
    "A: opacity, by which R G B are not to be blended again. "
    "Z: depth along the camera's axis."
)


@dataclass(frozen=True, slots=True)
class FloatImage:
    """One rendered view; float32 in memory, whichever precision the file has.

    Attributes:
        color: The sRGB-encoded color over the background, nominally in [0, 1], nothing clipped.
        opacity: 0 where the ray passed through, 1 where it was stopped.
        depth: The depth along the camera's axis; +inf where nothing was hit.
    """

    color: Float[np.ndarray, "height width 3"]
    opacity: Float[np.ndarray, "height width"]
    depth: Float[np.ndarray, "height width"]


def write_float_image(
    path: Path,
    color: Float[np.ndarray, "height width 3"],
    opacity: Float[np.ndarray, "height width"],
    depth: Float[np.ndarray, "height width"],
    *,
    half: bool = True,
) -> None:
    """Writes R G B A in half (or float) and Z in float, losslessly; no time stamp enters the bytes.

    Raises:
        InputError: A value is NaN; or color or opacity is infinite in the precision of the file
            (half ends at 65504). Infinite depth is meaningful and is kept, unless it is negative.
    """
    stored = np.float16 if half else np.float32
    with np.errstate(over="ignore"):  # reported below
        channels = {
            name: np.ascontiguousarray(color[..., index], dtype=stored)
            for index, name in enumerate(_COLOR_CHANNELS)
        }
        channels["A"] = np.ascontiguousarray(opacity, dtype=stored)
        channels["Z"] = np.ascontiguousarray(depth, dtype=np.float32)
    _check_values(path, channels)
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "comments": _COMMENTS,
    }
    with atomic_write(path) as partial:
        OpenEXR.File(header, channels).write(str(partial))


def read_float_image(path: Path) -> FloatImage:
    """Returns the view as it was written, widened to float32 (exact).

    Raises:
        InputError: The file is missing, damaged, lacks one of the channels R G B A Z, or one is
            not finite; depth may be infinite.
    """
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            pixels = {
                name: np.array(channel.pixels, dtype=np.float32)
                for name, channel in file.channels().items()
            }
    except (RuntimeError, ValueError) as error:
        raise InputError(
            str(path), "is not a whole OpenEXR file", "Delete it, and run the task that makes it"
        ) from error
    missing = [name for name in (*_COLOR_CHANNELS, "A", "Z") if name not in pixels]
    if missing:
        raise InputError(
            str(path), f"has no channel {' '.join(missing)}", "Give a file with R G B A Z"
        )
    _check_values(path, {name: pixels[name] for name in (*_COLOR_CHANNELS, "A", "Z")})
    color = np.stack([pixels[name] for name in _COLOR_CHANNELS], axis=-1)
    return FloatImage(color, pixels["A"], pixels["Z"])


def _check_values(path: Path, channels: dict[str, np.ndarray]) -> None:
    for name, pixels in channels.items():
        if np.isnan(pixels).any():
            raise InputError(str(path), f"channel {name} holds NaN", "Look for it in the renderer")
        if name == "Z" and np.isneginf(pixels).any():
            raise InputError(str(path), "channel Z holds -infinity", "Look for it in the renderer")
        if name != "Z" and np.isinf(pixels).any():
            raise InputError(
                str(path),
                f"channel {name} is beyond the range of {pixels.dtype}",
                "Write 32 bit floats, or look for the overflow in the renderer",
            )
