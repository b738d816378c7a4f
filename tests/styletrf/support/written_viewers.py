"""A viewer of what was baked, written to a file."""

from pathlib import Path

from styletrf.viewer.webpage.viewer_page import write_viewer

PIXEL = "data:image/gif;base64,R0lGODlhAQABAAAAACwAAAAAAQABAAA="


def written(content, path: Path, **more) -> Path:
    write_viewer(path, content, [PIXEL] * len(content.looks), 24.0, **more)
    return path
