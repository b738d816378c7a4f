"""The content images that a style network is trained on."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from styletrf.configuration import configured
from styletrf.content.content_choice import content_source
from styletrf.content.content_images import ContentConfig, write_content_images
from styletrf.content.content_sources import ContentSource, embedded_source
from styletrf.steps.step_run import StepRun

_FEWEST_PROCEDURAL = 64  # made in about 5 s, with which three photographs are content enough


def gather_content(
    inputs: Mapping[str, Path],
    out: Path,
    settings: Mapping[str, Any],
    run: StepRun,
    *,
    source: Path | None,
    fetched: Callable[[Path, Path], Path],
) -> None:
    """Writes the images as Parquet shards, and `content.json`.

    Args:
        inputs: `capture` if there is no source.
        out: The folder to fill.
        settings: Those of `ContentConfig`.
        run: Its progress is the number of images.
        source: A folder, a zip or an annotations file; None for the photographs of the scene and
            as many procedural images, or 64.
        fetched: Returns the folder for the images of an annotations file, from that file and from
            the folder of the run, which it may use.

    Raises:
        InputError: The source cannot be used, or has too few images.
    """
    config = configured(ContentConfig, settings)
    if source is None:
        chosen = _embedded(inputs["capture"] / "images", config.seed)
    else:
        chosen = content_source(source, lambda: fetched(source, run.work))
    write_content_images(chosen, out, config, run.progress)


def _embedded(folder: Path, seed: int) -> ContentSource:
    photographs = sorted(folder.iterdir())
    return embedded_source(photographs, max(len(photographs), _FEWEST_PROCEDURAL), seed)
