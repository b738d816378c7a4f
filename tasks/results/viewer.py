"""The interactive viewer of a scene in some styles."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import luigi

from pipeline.parameters import ListParameter
from pipeline.settings import out_root
from pipeline.task import RunContext, StoredTask
from styletrf.errors import InputError
from tasks.stages.field import RadianceField, TrajectoryFrames
from tasks.stages.linked_results import LinkedStage
from tasks.stages.path_parameters import PathParameters
from tasks.stages.scene import CameraPoses, SceneModel
from tasks.stages.stage import Stage
from tasks.stages.style import StyleImage
from tasks.stages.style_parameters import NetworkParameters, StyleParameters
from tasks.stages.stylization import StylizedField

PHOTOGRAPHS = "Photographs"


class Viewer(LinkedStage, PathParameters):
    """A page to walk around in: one geometry, and every style on it (`docs/viewer.md`).

    Leaves `viewer.html`, linked from `out/SCENE/`, and `STYLE.jpg` for each style, by which a
    report finds out whether the page beside it shows its style.
    """

    scene = luigi.Parameter(description="a folder in data/scenes")
    styles = ListParameter(description='such as ["mosaic", "udnie"]')
    content = NetworkParameters.content
    perceptual = NetworkParameters.perceptual
    stroke_scale = NetworkParameters.stroke_scale
    content_weight = NetworkParameters.content_weight
    transfer = NetworkParameters.transfer
    stylizer = NetworkParameters.stylizer
    colors = StyleParameters.colors
    match = StyleParameters.match
    rounds = StyleParameters.rounds
    tools = ("av", "numba", "opencv-contrib-python-headless", "torch")
    page = "viewer.html"

    def validate(self) -> None:
        """Refuses styles that are not each one name.

        Raises:
            InputError: With what to give instead.
        """
        super().validate()
        if not all(isinstance(style, str) and style for style in self.styles):
            problem = "has what is no name of an image in data/styles"
            raise InputError(f"--styles {list(self.styles)}", problem, 'Give such as ["mosaic"]')
        if len(set(self.styles)) < len(self.styles):
            raise InputError(f"--styles {list(self.styles)}", "names one twice", "Name each once")

    def requires(self) -> Mapping[str, Stage]:
        """The density, the appearances, the cameras, and what the paintings look like."""
        needed: dict[str, Stage] = {
            "field": self.upstream(RadianceField),
            "model": self.upstream(SceneModel),
            "poses": self.upstream(CameraPoses),
            "trajectory": self.upstream(TrajectoryFrames),
        }
        for style in self.styles:
            needed[f"style {style}"] = self.upstream(StyleImage, style=style)
            needed[f"stylized {style}"] = self.upstream(StylizedField, style=style)
        return needed

    def identity_parameters(self) -> Mapping[str, object]:
        """The names that the page shows."""
        return {"scene": self.scene, "styles": list(self.styles)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Bake the fields and write the page."""
        from styletrf.reports.embedding import small_jpeg
        from styletrf.viewer.viewed_scene import THUMBNAIL_PX, read_viewed_scene, thumbnail
        from styletrf.viewer.viewer_content import viewer_content
        from styletrf.viewer.webpage.viewer_page import write_viewer

        scene = read_viewed_scene(inputs)
        content = viewer_content(
            self.scene, scene.model, self._fields(inputs), scene.photographed, scene.path,
            run.progress,
        )  # fmt: skip
        paintings = [thumbnail(inputs[f"style {style}"] / "style.png") for style in self.styles]
        thumbnails = [scene.thumbnail, *paintings]
        write_viewer(out / "viewer.html", content, thumbnails, scene.frames_per_second)
        for style in self.styles:
            image = inputs[f"style {style}"] / "style.png"
            (out / f"{style}.jpg").write_bytes(small_jpeg(image, THUMBNAIL_PX))

    def _fields(self, inputs: Mapping[str, Path]) -> list[tuple[str, Callable[[], Any]]]:
        """Returns the names, and what loads the fields."""
        from styletrf.field.radiance_field import load_field, load_stylized_field

        field = inputs["field"]
        return [(PHOTOGRAPHS, partial(load_field, field))] + [
            (style, partial(load_stylized_field, field, inputs[f"stylized {style}"]))
            for style in self.styles
        ]

    @property
    def folder(self) -> Path:
        """Where the page is shown."""
        return Path(out_root(), self.scene)

    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        """The page, and a picture for each style."""
        pictures = {f"viewer.{style}.jpg": place(self) / f"{style}.jpg" for style in self.styles}
        return {"viewer.html": place(self) / "viewer.html", **pictures}
