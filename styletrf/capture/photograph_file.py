"""Writes the photographs that a capture makes: frames of videos and views of panoramas."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from styletrf.capture.capture_file import Photograph
from styletrf.files.digests import sha256_of
from styletrf.files.images import write_png


def write_photograph(
    out_dir: Path, photograph: Photograph, pixels: UInt8[np.ndarray, "height width 3"]
) -> Photograph:
    """Writes `images/<file>` as PNG; returns the photograph with the size and digest of this file.

    Args:
        out_dir: The folder of the capture, which has `images`.
        photograph: The photograph, whose size and digest are not known yet.
        pixels: Upright RGB of its width and height.
    """
    path = out_dir / "images" / photograph.file
    write_png(path, pixels, compression=3)
    content = path.read_bytes()
    return replace(photograph, size_bytes=len(content), sha256=sha256_of(content))
