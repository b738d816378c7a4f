"""A viewer of what was baked, written to a file."""

from pathlib import Path

from headless import with_text

from styletrf.viewer.webpage.viewer_page import write_viewer

PIXEL = "data:image/gif;base64,R0lGODlhAQABAAAAACwAAAAAAQABAAA="


def written(content, path: Path, **more) -> Path:
    write_viewer(path, content, [PIXEL] * len(content.looks), 24.0, **more)
    return path


def written_small(content, path: Path, width: int = 160) -> Path:
    """Returns a viewer whose pictures are at most so wide: quick ones."""
    page = written(content, path)
    with_text(page, page, '"mostPixels": 1600', f'"mostPixels": {width}')
    return page
