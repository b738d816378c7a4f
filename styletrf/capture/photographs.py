"""Photographs as users keep them: which files of a folder they are, and their upright pixels."""

import os
import re
from collections.abc import Set
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from styletrf.capture.decoding import decoded
from styletrf.errors import InputError
from styletrf.files.heif_images import HEIF_SUFFIXES
from styletrf.files.linked_folders import walk
from styletrf.files.unusual_images import is_premultiplied, unread_layout, white_level

PHOTOGRAPH_SUFFIXES = HEIF_SUFFIXES | frozenset(
    [
        ".bmp",
        ".jfif",
        ".jp2",
        ".jpe",
        ".jpeg",
        ".jpg",
        ".pbm",
        ".pgm",
        ".png",
        ".pnm",
        ".ppm",
        ".tif",
        ".tiff",
        ".webp",
    ]
)
"""Formats that OpenCV decodes faithfully, and those of phones. (OpenCV's AVIF loses 10 and 12
bits.)"""

FOREIGN_SUFFIXES = frozenset(
    [
        *(".3fr", ".arw", ".cr2", ".cr3", ".dcr", ".dng", ".nef", ".nrw", ".orf", ".pef", ".raf"),
        *(".rw2", ".rwl", ".srw", ".x3f"),
        *(".gif", ".jxl", ".psd"),
    ]
)
"""Raw files of cameras and other pictures, which have to be converted first."""

VIDEO_SUFFIXES = frozenset(
    [
        *(".3gp", ".avi", ".m2ts", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".mts"),
        *(".webm", ".wmv"),
    ]
)
"""Videos, whose frames may serve as photographs."""

FEWEST_PHOTOGRAPHS = 3

_ROWS = 256  # of a photograph at a time, since float64 takes ten times its memory


def list_photographs(folder: Path) -> list[Path]:
    """Returns the photographs below a folder by suffix, in natural order (`2.jpg` before `10.jpg`).

    Hidden files and folders, files that are no images, masks (`masks`) and the reduced copies that
    published scenes have (`images_4`) are passed over.

    Raises:
        InputError: The folder is missing, or holds fewer than three photographs; or as
            `files_below`.
    """
    if not folder.is_dir():
        raise InputError(str(folder), "there is no such folder", "Put the photographs there")
    photographs = photographs_below(folder)
    if len(photographs) < FEWEST_PHOTOGRAPHS:
        problem = too_few(folder, len(photographs))
        raise InputError(str(folder), problem, MORE_PHOTOGRAPHS)
    return photographs


def photographs_below(folder: Path) -> list[Path]:
    """Returns the photographs as `list_photographs` does, however few there are.

    Raises:
        InputError: As `files_below`.
    """
    return files_below(folder, PHOTOGRAPH_SUFFIXES)


def files_below(folder: Path, suffixes: Set[str]) -> list[Path]:
    """Returns the files of a scene below a folder that have such suffixes, in natural order.

    Folders behind links are entered, see `walk`.

    Raises:
        InputError: The name or the folder of a photograph, a video or another picture is not in
            UTF-8.
    """
    return [
        path for path in _pictures(folder) if path.suffix.lower() in suffixes and path.is_file()
    ]


def folder_of_pictures(scene: Path) -> Path:
    """Returns where the pictures of a scene lie: in `images`, or in itself if that holds none.

    Raises:
        InputError: As `files_below`.
    """
    pictures = PHOTOGRAPH_SUFFIXES | VIDEO_SUFFIXES
    return next((one for one in (scene / "images", scene) if files_below(one, pictures)), scene)


def dangling_links(folder: Path) -> list[Path]:
    """Returns the links that have a photograph's name and lead nowhere, in natural order.

    Raises:
        InputError: As `files_below`.
    """
    return [
        path
        for path in _pictures(folder)
        if path.suffix.lower() in PHOTOGRAPH_SUFFIXES and not path.exists()
    ]


def _pictures(folder: Path) -> list[Path]:
    """Returns the files and links of a scene that are pictures by their suffixes."""
    known = PHOTOGRAPH_SUFFIXES | VIDEO_SUFFIXES | FOREIGN_SUFFIXES
    entries = (place / name for place, _, names in walk(folder) for name in names)
    found = [path for path in entries if path.suffix.lower() in known and is_of_scene(path, folder)]
    for path in found:
        require_readable_name(str(path.relative_to(folder)))
    return sorted(found, key=lambda path: natural_order(str(path.relative_to(folder))))


def path_below(folder: Path, file: Path) -> Path:
    """Returns the path of a photograph below the folder of all; its name if it is elsewhere."""
    return file.relative_to(folder) if file.is_relative_to(folder) else Path(file.name)


def is_of_scene(path: Path, folder: Path) -> bool:
    """Returns whether a file below the folder is neither hidden nor in a folder of other images."""
    *folders, name = path.relative_to(folder).parts
    return not any(part[0] == "." for part in [*folders, name]) and not any(
        _OTHER_IMAGES.fullmatch(part) for part in folders
    )


def require_readable_name(name: str) -> None:
    """Refuses the name or the path of a file that is not in UTF-8: no text can hold it.

    Raises:
        InputError: The name is not in UTF-8.
    """
    try:
        name.encode()
    except UnicodeEncodeError as error:
        readable = os.fsencode(name).decode(errors="replace")
        raise InputError(readable, "its name is not in UTF-8", "Rename it") from error


_OTHER_IMAGES = re.compile(r"masks|images_\d+", re.IGNORECASE)
MORE_PHOTOGRAPHS = (
    f"At least {FEWEST_PHOTOGRAPHS} overlapping photographs of the place are needed, better 20 "
    "or more, as JPEG or PNG files"
)


def too_few(folder: Path, count: int) -> str:
    """Returns how few photographs there are below a folder, and which have to be converted.

    Raises:
        InputError: As `files_below`.
    """
    found = f"{count or 'no'} photograph{'' if count == 1 else 's'} found"
    foreign = sorted({path.suffix.lower() for path in files_below(folder, FOREIGN_SUFFIXES)})
    return found + (f" ({', '.join(foreign)} files must be converted first)" if foreign else "")


def natural_order(name: str) -> tuple[list[str | int], str]:
    """Returns a sorting key that compares runs of digits as numbers, the rest caselessly."""
    parts = re.split(r"([0-9]+)", name)
    return [int(part) if i % 2 else part.casefold() for i, part in enumerate(parts)], name


def read_photograph(path: Path, *, ground: float = 1.0) -> UInt8[np.ndarray, "height width 3"]:
    """Returns a photograph's upright RGB pixels: EXIF orientation applied, gray made RGB.

    More than 8 bits are rounded to 8. Transparent pixels are composited on white, as the published
    synthetic scenes want it, or on another gray.

    Args:
        path: The file.
        ground: The gray behind transparent pixels, from 0 (black) to 1 (white).

    Raises:
        InputError: The file cannot be read, is no image, is cut short or damaged, has too many
            pixels, or is a TIFF with an `unread_layout`.
    """
    try:
        encoded = path.read_bytes()
    except OSError as error:
        problem = f"cannot be read ({error.strerror})"
        raise InputError(str(path), problem, "Check the file and its permissions") from error
    if layout := unread_layout(encoded):
        raise InputError(str(path), f"is a TIFF of {layout}, which is not read", "Save it as PNG")
    try:
        pixels = decoded(encoded, is_heif=path.suffix.lower() in HEIF_SUFFIXES)
    except OverflowError as error:
        problem = "is too large to decode: it has more than 2^30 pixels, or 2^20 on a side"
        raise InputError(str(path), problem, "Reduce it") from error
    if pixels is None:
        problem = "is empty" if not encoded else "is cut short, damaged, or no image"
        raise InputError(str(path), problem, "Copy it again from where it came, or remove it")
    if pixels.dtype not in (np.uint8, np.uint16):
        raise InputError(str(path), f"has {pixels.dtype} pixels", "Save it with 8 or 16 bits")
    largest = np.iinfo(pixels.dtype).max
    white, multiplied = white_level(encoded, largest), is_premultiplied(encoded, largest)
    return _eight_bits_on(ground, pixels, white, multiplied=multiplied)


def _eight_bits_on(
    ground: float, pixels: np.ndarray, white: int, *, multiplied: bool
) -> UInt8[np.ndarray, "height width 3"]:
    """Returns RGB from BGR or BGRA of 8 or 16 bits whose white is this level, rounded once."""
    if pixels.shape[2] == 3 and white == 255:
        return np.ascontiguousarray(pixels[..., ::-1])
    blocks = (pixels[row : row + _ROWS] for row in range(0, len(pixels), _ROWS))
    rounded = [_rounded_on(ground, block, white, multiplied=multiplied) for block in blocks]
    return np.concatenate(rounded)


def _rounded_on(
    ground: float, pixels: np.ndarray, white: int, *, multiplied: bool
) -> UInt8[np.ndarray, "block_height width 3"]:
    color = np.minimum(pixels[..., 2::-1].astype(np.float64) / white, 1.0)
    if pixels.shape[2] == 4:
        alpha = pixels[..., 3:].astype(np.float64) / white
        color = np.minimum((color if multiplied else color * alpha) + ground * (1 - alpha), 1.0)
    return np.asarray(np.rint(color * 255), dtype=np.uint8)
