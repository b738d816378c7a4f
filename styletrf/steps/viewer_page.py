"""The interactive viewer of a scene in some styles."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from styletrf.field.radiance_field import RadianceField, load_field, load_stylized_field
from styletrf.reports.embedding import small_jpeg
from styletrf.steps.step_run import StepRun
from styletrf.viewer.viewed_scene import THUMBNAIL_PX, read_viewed_scene, thumbnail
from styletrf.viewer.viewer_content import viewer_content
from styletrf.viewer.webpage.viewer_page import write_viewer

PHOTOGRAPHS = "Photographs"
"""The name of the look that is not stylized."""


def write_viewer_page(
    inputs: Mapping[str, Path],
    out: Path,
    settings: Mapping[str, Any],
    run: StepRun,
    *,
    scene: str,
    styles: Sequence[str],
) -> None:
    """Writes `viewer.html`, and `STYLE.jpg` of each style.

    Args:
        inputs: `field`, `model`, `poses`, `trajectory`; `style NAME` and `stylized NAME` of each
            style.
        out: The folder to fill.
        settings: Empty.
        run: Its progress is that of baking the fields.
        scene: Its name, for the page.
        styles: Names of the styles.
    """
    viewed, looks = read_viewed_scene(inputs), _looks(inputs, styles)
    content = viewer_content(
        scene, viewed.model, looks, viewed.photographed, viewed.path, run.progress
    )
    paintings = {style: inputs[f"style {style}"] / "style.png" for style in styles}
    thumbnails = [viewed.thumbnail, *map(thumbnail, paintings.values())]
    write_viewer(out / "viewer.html", content, thumbnails, viewed.frames_per_second)
    for style, painting in paintings.items():
        (out / f"{style}.jpg").write_bytes(small_jpeg(painting, THUMBNAIL_PX))


def _looks(
    inputs: Mapping[str, Path], styles: Sequence[str]
) -> list[tuple[str, Callable[[], RadianceField]]]:
    """Returns the name of each look and the function that loads its field."""
    field = inputs["field"]
    stylized = [(s, partial(load_stylized_field, field, inputs[f"stylized {s}"])) for s in styles]
    return [(PHOTOGRAPHS, partial(load_field, field)), *stylized]
