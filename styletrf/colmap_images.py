"""The photographs as COLMAP is given them: upright PNGs of one size, named by their position."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from styletrf.colmap import pycolmap
from styletrf.photographs import read_photograph
from styletrf.progress import Progress
from styletrf.scene_capture import Capture


@dataclass(frozen=True, slots=True)
class ColmapImages:
    """A folder of PNGs of `width` x `height`, and what is known of their focal length."""

    folder: Path
    files: tuple[str, ...]
    width: int
    height: int
    focal_prior_px: float | None


def prepare_images(
    capture_dir: Path, capture: Capture, folder: Path, max_long_side: int, progress: Progress
) -> ColmapImages:
    """Writes the photographs of a capture into `folder`, upright and at most so large."""
    folder.mkdir(parents=True)
    first, total = capture.photographs[0], len(capture.photographs)
    scale = min(1.0, max_long_side / max(first.width, first.height))
    width, height = max(1, round(first.width * scale)), max(1, round(first.height * scale))
    files = tuple(f"{index:06d}.png" for index in range(total))
    for index, (photograph, file) in enumerate(zip(capture.photographs, files, strict=True)):
        progress(index, total)
        image = read_photograph(capture_dir / "images" / photograph.file)
        if scale < 1:
            image = np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA))
        write_png(folder / file, image, compression=1)
    progress(total, total)
    focal_px = _focal_prior(capture_dir, capture, max(width, height))
    return ColmapImages(folder, files, width, height, focal_px)


def _focal_prior(capture_dir: Path, capture: Capture, long_side: int) -> float | None:
    """Returns the median focal length that EXIF tells, in pixels of images so large.

    It is asked of the user's own files: the upright copies carry none.
    """
    focals = []
    for photograph in capture.photographs:
        path = capture_dir / "images" / photograph.file
        with suppress(ValueError):  # COLMAP reads fewer formats than OpenCV, and need not here
            lens = pycolmap.infer_camera_from_image(path)
            if lens.has_prior_focal_length:
                focals.append(lens.mean_focal_length() * long_side / max(lens.width, lens.height))
    return float(np.median(focals)) if focals else None


def write_png(path: Path, image: UInt8[np.ndarray, "height width 3"], compression: int) -> None:
    """Writes an RGB image; zlib's `compression` from 0 to 9. The same image, the same bytes."""
    bgr = np.ascontiguousarray(image[..., ::-1])
    _, encoded = cv2.imencode(".png", bgr, [cv2.IMWRITE_PNG_COMPRESSION, compression])
    path.write_bytes(encoded.tobytes())
