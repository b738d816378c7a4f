"""Frames of scenes in styles on one picture: a column a painting, a row a scene."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from styletrf.evaluation.metrics import Image
from styletrf.files.images import to_integers
from styletrf.style.style_image import read_style_image

_GAP_PX, _LABEL_PX, _SCALE, _QUALITY = 8, 28, 0.6, 90


def write_sheet(
    path: Path,
    paintings: Mapping[str, Path],
    scenes: Sequence[str],
    frames: Mapping[tuple[str, str], Image],
    width_px: int,
) -> None:
    """Writes a JPEG or PNG: the paintings on top, below them a frame of each scene in each.

    Args:
        path: Its suffix says which.
        paintings: The column's paintings by name.
        scenes: The names of the rows.
        frames: By scene and style.
        width_px: Of every picture.
    """
    heads = [_labeled(read_style_image(file), name, width_px) for name, file in paintings.items()]
    rows = [_row(heads)]
    for scene in scenes:
        labeled = [_labeled(frames[scene, s], f"{scene}, {s}", width_px) for s in paintings]
        rows.append(_row(labeled))
    bgr = cv2.cvtColor(np.concatenate(rows), cv2.COLOR_RGB2BGR)
    quality = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY] if path.suffix in (".jpg", ".jpeg") else []
    _, encoded = cv2.imencode(path.suffix, bgr, quality)
    path.write_bytes(encoded.tobytes())


def _labeled(image: np.ndarray, label: str, width_px: int) -> np.ndarray:
    """Returns 8 bit levels with the label below."""
    height = max(1, round(image.shape[0] * width_px / image.shape[1]))
    small = cv2.resize(to_integers(image), (width_px, height), interpolation=cv2.INTER_AREA)
    strip = np.full((_LABEL_PX, width_px, 3), 255, np.uint8)
    at = (4, _LABEL_PX - 9)
    cv2.putText(strip, label, at, cv2.FONT_HERSHEY_SIMPLEX, _SCALE, (0, 0, 0), 1, cv2.LINE_AA)
    return np.concatenate([np.asarray(small), strip])


def _row(pictures: Sequence[np.ndarray]) -> np.ndarray:
    """Returns pictures side by side, aligned at their labels."""
    height = max(picture.shape[0] for picture in pictures)
    padded = [
        np.pad(
            picture,
            ((height - picture.shape[0], _GAP_PX), (0, _GAP_PX), (0, 0)),
            constant_values=255,
        )
        for picture in pictures
    ]
    return np.concatenate(padded, axis=1)
