"""The sources of content photographs: a folder, a zip, or the embedded set.

(The fourth source, photographs fetched by a COCO annotations file, is
`styletrf.content.coco_fetch`.)
"""

import zipfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from styletrf.content.procedural_images import procedural_image
from styletrf.errors import InputError
from styletrf.files.heif_images import HEIF_SUFFIXES, heif_pixels
from styletrf.files.linked_folders import walk_files
from styletrf.files.zip_damage import ZIP_DAMAGE

CONTENT_SUFFIXES = HEIF_SUFFIXES | frozenset(
    [
        *(".bmp", ".jfif", ".jp2", ".jpe", ".jpeg", ".jpg", ".pbm", ".pgm", ".png", ".pnm", ".ppm"),
        *(".tif", ".tiff", ".webp"),
    ]
)
"""The suffixes of images, in lower case: the same as those of photographs."""

_HEIF_START = b"ftyp"  # after four bytes
_PROCEDURAL_SHAPE = (320, 400)  # height, width


@dataclass(frozen=True, slots=True)
class ContentSource:
    """Images by name; `read` returns one's encoded bytes and may be called from any thread."""

    subject: str  # the source as the user knows it
    names: tuple[str, ...]
    read: Callable[[str], bytes]
    close: Callable[[], None] = lambda: None  # after which nothing is read


def decoded_image(encoded: bytes) -> UInt8[np.ndarray, "height width 3"] | None:
    """Returns the pixels of a file, BGR; None if it is no image, or one that OpenCV refuses.

    OpenCV refuses images of more than 2^30 pixels, or of more than `OPENCV_IO_MAX_IMAGE_PIXELS`.
    """
    if encoded[4:8] == _HEIF_START:
        rgb = heif_pixels(encoded)
        return None if rgb is None else np.ascontiguousarray(rgb[..., 2::-1])
    try:
        buffer = np.frombuffer(encoded, dtype=np.uint8)
        return cv2.imdecode(buffer, cv2.IMREAD_COLOR) if buffer.size else None
    except cv2.error:
        return None


def folder_source(folder: Path) -> ContentSource:
    """Returns the images in a folder and the folders below it, by relative path, sorted.

    Folders behind links are entered, see `walk`.

    Raises:
        InputError: It is not a folder or holds no image.
    """
    if not folder.is_dir():
        raise InputError(str(folder), "is not a folder", "Give a folder of photographs")
    files = (file.relative_to(folder) for file in walk_files(folder) if file.is_file())
    names = tuple(sorted(file.as_posix() for file in files if _is_image(file.as_posix())))
    return ContentSource(
        str(folder), _some(str(folder), names), lambda n: (folder / n).read_bytes()
    )


def zip_source(path: Path) -> ContentSource:
    """Returns the images in a zip, such as COCO's `train2017.zip`, read without unpacking it.

    Raises:
        InputError: It is not a zip or holds no image.
    """
    with ExitStack() as opened:
        try:
            archive = opened.enter_context(zipfile.ZipFile(path))
        except ZIP_DAMAGE as error:
            problem = f"is not a whole zip ({error})"
            raise InputError(str(path), problem, "Fetch it again") from error
        names = tuple(sorted(name for name in archive.namelist() if _is_image(name)))
        names = _some(str(path), names)
        return ContentSource(str(path), names, archive.read, opened.pop_all().close)


def embedded_source(photographs: Sequence[Path], n_procedural: int, seed: int) -> ContentSource:
    """Returns the set that needs nothing else: photographs of the scene and procedural images.

    Args:
        photographs: Files, of distinct names.
        n_procedural: How many images to make; the k-th depends on `seed` and k alone.
        seed: Decides the procedural images.
    """
    readers: dict[str, Callable[[], bytes]] = {
        f"procedural-{k:05d}": partial(_procedural_png, seed, k) for k in range(n_procedural)
    }
    readers |= {f"photograph-{file.name}": file.read_bytes for file in photographs}
    names = _some("the embedded content", tuple(sorted(readers)))
    return ContentSource("the embedded content", names, lambda name: readers[name]())


def _procedural_png(seed: int, index: int) -> bytes:
    image = procedural_image(np.random.default_rng([seed, index]), *_PROCEDURAL_SHAPE)
    return cv2.imencode(".png", image[..., ::-1])[1].tobytes()


def _is_image(name: str) -> bool:
    hidden = any(part.startswith((".", "__MACOSX")) for part in name.split("/"))
    return not hidden and Path(name).suffix.lower() in CONTENT_SUFFIXES


def _some(subject: str, names: tuple[str, ...]) -> tuple[str, ...]:
    if not names:
        kinds = ", ".join(sorted(CONTENT_SUFFIXES))
        raise InputError(subject, f"holds no image ({kinds})", "Give one that does")
    return names
