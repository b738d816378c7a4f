"""Images that OpenCV does not decode faithfully: of unusual depths, or with transparency."""

import io
import re
from typing import Literal

import numpy as np
from jaxtyping import UInt8
from PIL import Image

_TIFF = (b"II*\x00", b"MM\x00*")
_BIG_TIFF = (b"II+\x00", b"MM\x00+")  # of 64-bit offsets
_JPEG_2000 = (b"\x00\x00\x00\x0cjP  ", b"\xff\x4f\xff\x51")
_SIZE_MARKER = b"\xff\x4f\xff\x51"  # the start of a codestream, and of the segment SIZ
_CHANNELS, _FIRST_DEPTH, _STEP = 36, 38, 3  # bytes of SIZ behind its marker
_BITS, _PHOTOMETRIC, _SAMPLES_PER_PIXEL = 258, 262, 277  # tags of TIFF
_PLANAR, _EXTRA_SAMPLES = 284, 338
_BLACK_IS_ZERO, _IN_PLANES = 1, 2  # their values
_MULTIPLIED, _APART = 1, 2  # kinds of alpha in a TIFF (associated, unassociated)
_GAP = rb"(?:\s|#[^\r\n]*[\r\n])+"
_PNM = re.compile(rb"P([2356])" + _GAP + rb"\d+" + _GAP + rb"\d+" + _GAP + rb"(\d+)")
_ASCII = (b"2", b"3")


def white_level(file: bytes, largest: int) -> int:
    """Returns the level of white in the pixels that OpenCV decodes from a file.

    It is below the largest of their type where a PNM names another one, or a JPEG 2000 has 9 to 15
    bits. OpenCV itself stretches PNM in ASCII to 8 bits, but not to 16.

    Args:
        file: The content of the file.
        largest: The largest level of the type of the pixels, 255 or 65535.
    """
    if named := _PNM.match(file):
        is_stretched = named[1] in _ASCII and largest == 255
        return largest if is_stretched else int(named[2]) or largest
    if file.startswith(_JPEG_2000) and (depths := _depths(file)):
        return min((1 << max(depths)) - 1, largest)
    return largest


def _depths(file: bytes) -> list[int]:
    """Returns the bits of each channel of a JPEG 2000; none where the file has no header."""
    _, _, segment = file.partition(_SIZE_MARKER)
    channels = int.from_bytes(segment[_CHANNELS:_FIRST_DEPTH])
    depths = segment[_FIRST_DEPTH::_STEP][:channels]
    return [(depth & 0x7F) + 1 for depth in depths]


def is_gray_with_alpha(file: bytes) -> bool:
    """Returns whether a file is a TIFF or JPEG 2000 of gray and alpha, by its header."""
    if file.startswith(_JPEG_2000):
        return len(_depths(file)) == 2
    is_gray = _tag_of_tiff(file, _PHOTOMETRIC) == _BLACK_IS_ZERO
    return is_gray and _tag_of_tiff(file, _SAMPLES_PER_PIXEL) == 2


def unread_layout(file: bytes) -> str:
    """Returns the layout of a TIFF that no decoder here reads; "" of any other file.

    OpenCV garbles planes of 16 bits, and Pillow those of gray and alpha. Neither keeps the alpha of
    gray of 16 bits.
    """
    samples, bits = (_tag_of_tiff(file, tag) for tag in (_SAMPLES_PER_PIXEL, _BITS))
    has_planes = _tag_of_tiff(file, _PLANAR) == _IN_PLANES
    if has_planes and (samples == 2 or (samples > 2 and bits == 16)):
        return "planes, one for each channel"
    is_gray = _tag_of_tiff(file, _PHOTOMETRIC) == _BLACK_IS_ZERO
    return "gray of 16 bits with alpha" if is_gray and samples == 2 and bits == 16 else ""


def is_premultiplied(file: bytes, largest: int) -> bool:
    """Returns whether colors that OpenCV decodes from a file are multiplied by their alpha.

    A TIFF may hold them so, and libtiff multiplies those of 8 bits.

    Args:
        file: The content of the file.
        largest: The largest level of the type of the pixels, 255 or 65535.
    """
    if _tag_of_tiff(file, _SAMPLES_PER_PIXEL) != 4:
        return False
    alpha = _tag_of_tiff(file, _EXTRA_SAMPLES)
    return alpha == _MULTIPLIED or (alpha == _APART and largest == 255)


def _tag_of_tiff(file: bytes, tag: int) -> int:
    """Returns the (first) short number of a tag of the first picture of a TIFF; 0 without it."""
    if not file.startswith((*_TIFF, *_BIG_TIFF)):
        return 0
    order: Literal["little", "big"] = "little" if file.startswith(b"II") else "big"
    offset_bytes, count_bytes = (8, 8) if file.startswith(_BIG_TIFF) else (4, 2)
    each = 4 + 2 * offset_bytes  # its tag, type, number of values, and these or where they are

    def number(start: int, size: int) -> int:
        return int.from_bytes(file[start : start + size], order)

    start = number(offset_bytes, offset_bytes)
    entries = start + count_bytes
    for entry in range(entries, min(entries + each * number(start, count_bytes), len(file)), each):
        if number(entry, 2) == tag:
            value = entry + 4 + offset_bytes
            is_elsewhere = 2 * number(entry + 4, offset_bytes) > offset_bytes
            return number(number(value, offset_bytes) if is_elsewhere else value, 2)
    return 0


def gray_with_alpha(file: bytes) -> UInt8[np.ndarray, "height width 4"] | None:
    """Returns a file that `is_gray_with_alpha` as RGBA of 8 bits.

    It is None where the file is damaged, or a TIFF with an `unread_layout`.
    """
    try:
        with Image.open(io.BytesIO(file)) as opened:
            return np.array(opened.convert("LA").convert("RGBA"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None
