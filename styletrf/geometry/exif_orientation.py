"""The orientation in a photograph's EXIF data: how its stored pixels are turned upright."""

import io
import struct
from contextlib import suppress
from pathlib import Path

import numpy as np
from jaxtyping import Int
from PIL import Image
from PIL.PngImagePlugin import PngImageFile
from PIL.TiffImagePlugin import TiffImageFile

UPRIGHT = 1
FIRST_TRANSPOSED = 5  # from this orientation on, width and height change places
_TAG = 0x0112
_WIDTH_TAG, _HEIGHT_TAG = 0x0100, 0x0101  # of a TIFF
_PNG_SIGNATURE_BYTES = 8
_MIRRORED_X, _MIRRORED_Y = (2, 3, 6, 7), (3, 4, 7, 8)  # EXIF 2.3, once x and y changed places
_UNREADABLE = (OSError, SyntaxError, ValueError, struct.error, Image.DecompressionBombError)


def stored_size(file: Path) -> tuple[tuple[int, int], int]:
    """Returns width and height of a photograph as it is stored, and how it is turned upright.

    The orientation is 1 to 8, and 1 where there is none. A file that Pillow cannot read has the
    size 0, 0.
    """
    with suppress(*_UNREADABLE), Image.open(file) as opened:
        if isinstance(opened, TiffImageFile):  # whose `size` is that of the upright picture
            tags = opened.tag_v2
            return (tags[_WIDTH_TAG], tags[_HEIGHT_TAG]), _possible(tags.get(_TAG))
        return opened.size, orientation_of(opened)
    return (0, 0), UPRIGHT


def orientation_in_exif(file: bytes) -> int:
    """Returns the orientation that the EXIF block of a file names, from 1 to 8; else 1.

    A TIFF has none: its orientation is a tag of its own, by which OpenCV turns it.
    """
    with suppress(*_UNREADABLE), Image.open(io.BytesIO(file)) as opened:
        return orientation_of(opened)
    return UPRIGHT


def orientation_of(opened: Image.Image) -> int:
    """Returns the orientation that the EXIF block of an image names, from 1 to 8.

    Pillow's `getexif` would take it from XMP as well, which OpenCV does not read.
    """
    exif = Image.Exif()
    with suppress(*_UNREADABLE):
        block = opened.info.get("exif", b"")
        exif.load(block or _exif_behind_pixels(opened))
        return _possible(exif.get(_TAG))
    return UPRIGHT


def _exif_behind_pixels(opened: Image.Image) -> bytes:
    """Returns the EXIF block of a PNG that Pillow reads with the pixels alone; else nothing."""
    if not isinstance(opened, PngImageFile) or opened.fp is None:
        return b""
    file = opened.fp
    position = file.tell()
    file.seek(_PNG_SIGNATURE_BYTES)
    block = b""
    while not block and len(head := file.read(8)) == 8:
        length, kind = struct.unpack(">I4s", head)
        if kind == b"eXIf":
            block = file.read(length)
        file.seek(length + 4, io.SEEK_CUR)  # and the checksum
    file.seek(position)
    return block


def _possible(orientation: object) -> int:
    """Returns an orientation from 1 to 8; 1 for anything else."""
    return orientation if isinstance(orientation, int) and orientation in range(1, 9) else UPRIGHT


def upright_axes(orientation: int) -> Int[np.ndarray, "2 2"]:
    """Returns the matrix that takes x and y of the stored picture to those of the upright one.

    Both run from the middle of the picture. The determinant is -1 where the picture is mirrored.
    """
    mirrored = (orientation in _MIRRORED_X, orientation in _MIRRORED_Y)
    order = np.eye(2, dtype=np.int64)[:: -1 if orientation >= FIRST_TRANSPOSED else 1]
    return np.where(mirrored, -1, 1)[:, None] * order


def turned_upright(pixels: np.ndarray, orientation: int) -> np.ndarray:
    """Returns stored pixels (height, width, ...) as they stand upright, without a copy."""
    if orientation >= FIRST_TRANSPOSED:
        pixels = pixels.swapaxes(0, 1)
    step_x, step_y = upright_axes(orientation).sum(axis=1)
    return pixels[::step_y, ::step_x]
