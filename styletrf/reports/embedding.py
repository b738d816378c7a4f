"""Files inside a page, as `data:` URIs, so that the page needs nothing beside it."""

from base64 import b64encode
from pathlib import Path

import cv2
import numpy as np

from styletrf.files.images import read_rgb, to_integers

_QUALITY = 90  # of a JPEG, in which a painted frame shows no blocks


def embedded_video(path: Path) -> str:
    """Returns an MP4 file as it is, as a URI.

    Raises:
        OSError: The file cannot be read.
    """
    return _uri("video/mp4", path.read_bytes())


def embedded_image(path: Path, longest_px: int) -> str:
    """Returns an image as a JPEG whose longer side has at most so many pixels, as a URI.

    Raises:
        InputError: The file cannot be read, or is no image.
    """
    return _uri("image/jpeg", small_jpeg(path, longest_px))


def small_jpeg(path: Path, longest_px: int) -> bytes:
    """Returns an image as a JPEG whose longer side has at most so many pixels.

    Raises:
        InputError: The file cannot be read, or is no image.
    """
    pixels = to_integers(read_rgb(path))
    fraction = min(1.0, longest_px / max(pixels.shape[:2]))
    if fraction < 1:
        height, width = (max(1, round(fraction * side)) for side in pixels.shape[:2])
        pixels = np.asarray(cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA))
    bgr = cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR)
    _, encoded = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return encoded.tobytes()


def embedded_bytes(uri: str) -> int:
    """Returns how many bytes a URI holds, base64's padding apart."""
    return len(uri.partition(",")[2].rstrip("=")) * 3 // 4


def _uri(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{b64encode(content).decode()}"
