"""The size of a photograph, without its pixels where its header says it."""

from contextlib import suppress
from pathlib import Path

from PIL import Image

from styletrf.capture.photographs import read_photograph

_OWN_HEADER = ("JPEG", "PNG")  # which say their orientation in EXIF alone


def photograph_size(path: Path) -> tuple[int, int]:
    """Returns width and height in pixels of a photograph as `read_photograph` returns it.

    Where there is no EXIF, which may turn it, the header is read and nothing else.

    Raises:
        InputError: As `read_photograph`; not all damage is found.
    """
    with (
        suppress(OSError, SyntaxError, ValueError, Image.DecompressionBombError),
        Image.open(path) as opened,
    ):
        if opened.format in _OWN_HEADER and "exif" not in opened.info:
            return opened.size
    height, width, _ = read_photograph(path).shape
    return width, height
