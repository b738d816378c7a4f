"""Panoramas as photographs of a capture: the views cut from each, written as files."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from styletrf.capture.capture_file import Photograph
from styletrf.capture.masks import MASKS, counted_pixels
from styletrf.capture.panorama.panorama_views import Image, cut_views, view_name
from styletrf.capture.photograph_file import write_photograph
from styletrf.files.images import write_png


def cut_photographs(
    panorama: Photograph, pixels: Image, out_dir: Path, mask: Image | None = None
) -> Iterator[Photograph]:
    """Writes the views of a panorama as PNGs, their masks too, and yields them.

    The views are named by the panorama and their direction. A view that is masked all over is left
    out.

    Args:
        panorama: The panorama as a photograph.
        pixels: The pixels of the panorama.
        out_dir: Has `images` and, where there is a mask, `masks`.
        mask: The mask of the panorama, of the same size; black where it does not count.
    """
    masks = dict(cut_views(mask)) if mask is not None else {}
    for direction, view in cut_views(pixels):
        name = view_name(panorama.name, direction)
        if direction in masks:
            if not counted_pixels(masks[direction]).any():
                continue
            write_png(out_dir / MASKS / f"{name}.png", masks[direction], compression=1)
        height, width = view.shape[:2]
        photograph = replace(
            panorama,
            name=name,
            file=f"{name}.png",
            width=width,
            height=height,
            panorama=panorama.name,
            direction=direction,
        )
        yield write_photograph(out_dir, photograph, view)
