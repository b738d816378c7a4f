"""HEIC, HEIF and AVIF files, as phones keep photographs: their upright pixels and focal length."""

import io
import math
from pathlib import Path

import numpy as np
import pi_heif
from jaxtyping import UInt8
from PIL import Image, ImageOps
from PIL.AvifImagePlugin import AvifImageFile

HEIF_SUFFIXES = frozenset([".avif", ".heic", ".heif", ".hif"])

_AVIF_BRANDS = (b"avif", b"avis")
_EXIF_IFD, _FOCAL_LENGTH_35MM = 0x8769, 0xA405
_FILM_DIAGONAL_MM = math.hypot(36, 24)


def heif_pixels(encoded: bytes) -> UInt8[np.ndarray, "height width channels"] | None:
    """Returns upright RGB or RGBA of 8 bits, or None where the file is damaged or no such image."""
    opened = _opened(encoded)
    if opened is None:
        return None
    try:
        upright = ImageOps.exif_transpose(opened)
        mode = "RGBA" if upright.has_transparency_data else "RGB"
        return np.array(upright.convert(mode))
    except (OSError, ValueError, RuntimeError, SyntaxError):
        return None


def heif_focal_px(path: Path, long_side: int) -> float | None:
    """Returns the focal length that EXIF names for 35 mm film, in pixels of an image of this size.

    Film and photograph are compared by their diagonals (CIPA DCG-001).
    """
    opened = _opened(path.read_bytes())
    focal_mm = opened.getexif().get_ifd(_EXIF_IFD).get(_FOCAL_LENGTH_35MM) if opened else None
    if opened is None or not focal_mm:
        return None
    diagonal_px = math.hypot(*opened.size) * long_side / max(opened.size)
    return float(focal_mm) / _FILM_DIAGONAL_MM * diagonal_px


def _opened(encoded: bytes) -> Image.Image | None:
    """Returns the image of a file; that of HEIC already stands upright."""
    file = io.BytesIO(encoded)
    try:
        if encoded[8:12] in _AVIF_BRANDS:
            return AvifImageFile(file)
        image: Image.Image = pi_heif.open_heif(file).to_pillow()
        return image
    except (OSError, ValueError, RuntimeError, SyntaxError):
        return None
