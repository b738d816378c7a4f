"""A viewer of what was baked, written to a file."""

from dataclasses import replace
from pathlib import Path

from headless import with_text

from styletrf.viewer.webpage.viewer_page import write_viewer

PIXEL = "data:image/gif;base64,R0lGODlhAQABAAAAACwAAAAAAQABAAA="


def written(content, path: Path, **more) -> Path:
    write_viewer(path, content, [PIXEL] * len(content.looks), 24.0, **more)
    return path


def written_small(content, path: Path, width: int = 160, **more) -> Path:
    """Returns a viewer whose pictures are at most so wide: quick ones."""
    page = written(content, path, **more)
    with_text(page, page, '"mostPixels": 1600', f'"mostPixels": {width}')
    return page


def with_third_painting(content):
    """Returns the content with one more painting: the first one in brighter colors."""
    look = content.looks[1]
    brighter = replace(look.codes, low=look.codes.low + 1)
    return replace(content, looks=[*content.looks, replace(look, name="style 3", codes=brighter)])
