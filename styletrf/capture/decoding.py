"""Decodes the file of a photograph, and notices where it is damaged."""

import os
import re
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import cv2
import numpy as np

from styletrf.files.heif_images import heif_pixels
from styletrf.files.unusual_images import gray_with_alpha, is_gray_with_alpha
from styletrf.geometry.exif_orientation import orientation_in_exif, turned_upright

# The messages of libjpeg about damaged data. It also warns of harmless things: padding before the
# last marker, the scan parameters that some phones write.
_JPEG_DAMAGE = re.compile(r"premature end|bad Huffman|extraneous bytes before marker 0xd[0-7]")
# The messages of decoders, harmless or not; all other lines come from other threads.
_OF_DECODERS = re.compile(
    rb"Corrupt JPEG|Premature end of JPEG|Invalid SOS|Inconsistent progression|Unknown Adobe color"
    rb"|Warning: unknown JFIF|Application transferred|libpng |TIFF\w+:"
    rb"|\[ ?(?:WARN|ERROR|INFO|DEBUG):|\r?\n"
)
_JPEG_START = b"\xff\xd8"
_JPEG_MARKER = re.compile(rb"\xff[\x01-\xcf\xd8-\xfe]", re.DOTALL)  # not one within a scan
_UPRIGHT = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH  # BGR: RGB garbles 16-bit TIFF in OpenCV 5.0
_SIZE_BOUND = "CV_IO_MAX_IMAGE"  # in OpenCV's errors: of 2^30 pixels, and of 2^20 a side
_STANDARD_ERROR = threading.Lock()


def decoded(file: bytes, *, is_heif: bool) -> np.ndarray | None:
    """Returns pixels BGR or BGRA of any depth, or None where there is any sign of damage.

    Raises:
        OverflowError: OpenCV decodes no image of so many pixels.
    """
    if is_heif:
        return _as_bgr(heif_pixels(file))
    if is_gray_with_alpha(file) and (rgba := gray_with_alpha(file)) is not None:
        return _as_bgr(rgba)
    if file.startswith(_JPEG_START) and not _jpeg_ends(file):
        return None
    encoded = np.frombuffer(file, np.uint8)
    with _captured_stderr() as complaints:
        try:
            may_be_transparent = not file.startswith(_JPEG_START)  # no JPEG is
            pixels = cv2.imdecode(encoded, cv2.IMREAD_UNCHANGED if may_be_transparent else _UPRIGHT)
            if may_be_transparent and pixels is not None:
                # IMREAD_UNCHANGED leaves a photograph lying on its side
                is_rgba = pixels.shape[2:] == (4,)
                pixels = _turned(pixels, file) if is_rgba else cv2.imdecode(encoded, _UPRIGHT)
        except cv2.error as error:
            if _SIZE_BOUND in str(error):
                raise OverflowError(str(error)) from error
            return None
    return None if _JPEG_DAMAGE.search("".join(complaints)) else pixels


def _turned(pixels: np.ndarray, file: bytes) -> np.ndarray:
    """Returns the stored pixels of a file as its EXIF data turn them upright."""
    return turned_upright(pixels, orientation_in_exif(file))


def _jpeg_ends(file: bytes) -> bool:
    """Returns whether the segments of a JPEG lead to its end-of-image marker.

    Thumbnails, which have one of their own, lie within segments; phones append data after it.
    """
    position = len(_JPEG_START)
    while marker := _JPEG_MARKER.search(file, position):
        if marker.group() == b"\xff\xd9":
            return True
        position = marker.end() + int.from_bytes(file[marker.end() : marker.end() + 2])
    return False


def _as_bgr(rgb: np.ndarray | None) -> np.ndarray | None:
    """Returns BGR or BGRA from RGB or RGBA."""
    return None if rgb is None else rgb[..., [2, 1, 0, 3][: rgb.shape[2]]]


@contextmanager
def _captured_stderr() -> Iterator[list[str]]:
    """Collects the lines that C libraries write to standard error, once the block is left.

    libjpeg replaces missing data by gray and reports it only on standard error. The lines that
    other threads write there meanwhile follow later.
    """
    complaints: list[str] = []
    with _STANDARD_ERROR, tempfile.TemporaryFile() as log:
        sys.stderr.flush()
        standard_error = os.dup(2)
        os.dup2(log.fileno(), 2)
        try:
            yield complaints
        finally:
            os.dup2(standard_error, 2)
            os.close(standard_error)
            log.seek(0)
            lines = log.read().splitlines(keepends=True)
            complaints.extend(line.decode(errors="replace") for line in lines)
            if others := [line for line in lines if not _OF_DECODERS.match(line)]:
                os.write(2, b"".join(others))
