"""Panoramas as photographs of a capture: the views cut from each, written as files."""

import hashlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from styletrf.capture.capture_file import Photograph
from styletrf.capture.masks import MASKS, counted_pixels
from styletrf.capture.panorama.panorama_views import Image, cut_views, view_name
from styletrf.files.images import write_png


def cut_photographs(
    panorama: Photograph, pixels: Image, out_dir: Path, mask: Image | None = None
) -> Iterator[Photograph]:
    """Writes the views of a panorama as PNGs, their masks too, and yields them.

    They are named by the panorama and their direction. One that is masked all over is left out.

    Args:
        panorama: What is known of it.
        pixels: Of the panorama.
        out_dir: Has `images` and, where there is a mask, `masks`.
        mask: Of the panorama, as large; black where it does not count.
    """
    masks = dict(cut_views(mask)) if mask is not None else {}
    for direction, view in cut_views(pixels):
        name = view_name(panorama.name, direction)
        if direction in masks:
            if not counted_pixels(masks[direction]).any():
                continue
            write_png(out_dir / MASKS / f"{name}.png", masks[direction], compression=1)
        file = out_dir / "images" / f"{name}.png"
        write_png(file, view, compression=3)
        data = file.read_bytes()
        yield replace(
            panorama,
            name=name,
            file=file.name,
            width=view.shape[1],
            height=view.shape[0],
            size_bytes=len(data),
            sha256=hashlib.sha256(data).hexdigest(),
            panorama=panorama.name,
            direction=direction,
        )
