"""RGB images in files: float32 in [0, 1] in memory, 8 or 16 bits in PNG."""

from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float, UInt8, UInt16

from styletrf.errors import InputError, NotFiniteError
from styletrf.files.atomic_write import atomic_write

Bits = Literal[8, 16]


def read_rgb(path: Path) -> Float[np.ndarray, "height width 3"]:
    """Returns an 8 or 16 bit image as float32 in [0, 1], gray repeated to RGB, alpha left out.

    Raises:
        InputError: The file is missing, empty, truncated, or no image of 8 or 16 bits.
    """
    try:
        encoded = np.fromfile(path, dtype=np.uint8)
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})", "Check it") from error
    pixels = None
    if encoded.size:
        pixels = cv2.imdecode(encoded, cv2.IMREAD_COLOR_RGB | cv2.IMREAD_ANYDEPTH)
    if pixels is None or pixels.dtype not in (np.uint8, np.uint16):
        raise InputError(
            str(path), "is not a whole image of 8 or 16 bits", "Replace it by a PNG or JPEG file"
        )
    return from_integers(pixels)


def write_rgb(path: Path, image: Float[np.ndarray, "height width 3"], bits: Bits = 8) -> None:
    """Writes a PNG of 8 or 16 bits a channel; the same image gives the same bytes.

    Values are rounded to the nearest level, which is at most 0.5 / (2^bits - 1) away; values
    outside [0, 1] are clipped.

    Raises:
        InputError: The image is not finite.
    """
    if not np.isfinite(image).all():
        problem = "the image to write holds NaN or infinity"
        raise InputError(str(path), problem, "Look for it where it was made")
    bgr = cv2.cvtColor(to_integers(image, bits), cv2.COLOR_RGB2BGR)
    _, encoded = cv2.imencode(".png", bgr)
    with atomic_write(path) as partial:
        partial.write_bytes(encoded.tobytes())


def to_integers(
    image: Float[np.ndarray, "height width 3"], bits: Bits = 8
) -> UInt8[np.ndarray, "height width 3"] | UInt16[np.ndarray, "height width 3"]:
    """Returns the nearest levels of 8 or 16 bits, values outside [0, 1] clipped.

    Raises:
        NotFiniteError: A value is not; NaN would become black.
    """
    if not np.isfinite(image).all():
        raise NotFiniteError("levels", "the image", f"before it is rounded to {bits} bits")
    dtype = np.uint8 if bits == 8 else np.uint16
    levels = np.clip(image, 0.0, 1.0).astype(np.float64) * np.iinfo(dtype).max
    return np.asarray(np.rint(levels), dtype=dtype)


def from_integers(
    pixels: UInt8[np.ndarray, "height width 3"] | UInt16[np.ndarray, "height width 3"],
) -> Float[np.ndarray, "height width 3"]:
    """Returns float32 in [0, 1]; the inverse of `to_integers` on its range."""
    return np.asarray(pixels / np.float32(np.iinfo(pixels.dtype).max), dtype=np.float32)


def write_png(path: Path, image: UInt8[np.ndarray, "height width 3"], compression: int) -> None:
    """Writes an RGB image; zlib's `compression` from 0 to 9. The same image, the same bytes."""
    bgr = np.ascontiguousarray(image[..., ::-1])
    _, encoded = cv2.imencode(".png", bgr, [cv2.IMWRITE_PNG_COMPRESSION, compression])
    path.write_bytes(encoded.tobytes())
