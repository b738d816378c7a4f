"""The size of a photograph, without its pixels where its header says it."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from PIL import Image

from styletrf.capture.photographs import read_photograph
from styletrf.errors import InputError
from styletrf.geometry.exif_orientation import FIRST_TRANSPOSED, orientation_of


def first_size(files: Sequence[Path]) -> tuple[int, int]:
    """Returns width and height of the first photograph that can be read.

    Raises:
        InputError: None of them can be read; it is the error of the first.
    """
    errors = []
    for file in files:
        try:
            return photograph_size(file)
        except InputError as error:
            errors.append(error)
    raise errors[0]


def photograph_size(path: Path) -> tuple[int, int]:
    """Returns width and height in pixels of a photograph as `read_photograph` returns it.

    Of a JPEG, and of a PNG whose EXIF, if any, lies behind its pixels, these are not decoded.

    Raises:
        InputError: As `read_photograph`; not all damage is found.
    """
    with (
        suppress(OSError, SyntaxError, ValueError, Image.DecompressionBombError),
        Image.open(path) as opened,
    ):
        if opened.format == "JPEG" or (opened.format == "PNG" and "exif" not in opened.info):
            is_turned = orientation_of(opened) >= FIRST_TRANSPOSED
            return opened.size[::-1] if is_turned else opened.size
    height, width, _ = read_photograph(path).shape
    return width, height
