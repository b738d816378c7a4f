"""Which kind of content source a path is."""

from collections.abc import Callable
from pathlib import Path

from styletrf.content.coco_fetch import coco_source
from styletrf.content.content_sources import ContentSource, folder_source, zip_source
from styletrf.errors import InputError


def content_source(path: Path, cache: Callable[[], Path]) -> ContentSource:
    """Returns the images of a folder, of a zip, or of a COCO annotations file.

    Args:
        path: The source.
        cache: Returns an existing folder, where images fetched by an annotations file are kept.

    Raises:
        InputError: The path is none of these.
    """
    if path.is_dir():
        return folder_source(path)
    if path.suffix.lower() == ".zip":
        return zip_source(path)
    if path.suffix.lower() == ".json":
        return coco_source(path, cache())
    problem = "is not a folder of images, a zip or a COCO annotations file"
    raise InputError(
        f"content {path}",
        problem if path.exists() else "there is no such file or folder",
        "Give a folder, a .zip or an instances_*.json, by path or by its name in data/content",
    )
