"""The interactive viewer of a scene in some styles."""

from collections.abc import Callable, Mapping
from pathlib import Path

from pipeline.settings import out_root
from pipeline.task import RunContext, StoredTask
from tasks.results.scene_in_styles import SceneInStyles
from tasks.stages.field import RadianceField, TrajectoryFrames
from tasks.stages.scene import CameraPoses, SceneModel
from tasks.stages.stage import Stage
from tasks.stages.style import StyleImage
from tasks.stages.stylization import StylizedField


class Viewer(SceneInStyles):
    """A page to walk around in: one geometry, and every style on it (`docs/viewer.md`).

    Leaves `viewer.html`, linked from `out/SCENE/`, and `STYLE.jpg` for each style. By these images
    a report finds out whether the page beside it shows its style.
    """

    tools = ("av", "numba", "opencv-contrib-python-headless", "torch")
    page = "viewer.html"

    def requires(self) -> Mapping[str, Stage]:
        """Returns the density, the appearances, the cameras and the paintings."""
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
        """Returns the names that the page shows."""
        return {"scene": self.scene, "styles": list(self.styles)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Bakes the fields and writes the page."""
        from styletrf.steps.viewer_page import write_viewer_page

        write_viewer_page(inputs, out, {}, self.step_run(run), scene=self.scene, styles=self.styles)

    @property
    def folder(self) -> Path:
        """Returns the folder of the page."""
        return Path(out_root(), self.scene)

    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        """Returns the page, and a picture for each style."""
        pictures = {f"viewer.{style}.jpg": place(self) / f"{style}.jpg" for style in self.styles}
        return {"viewer.html": place(self) / "viewer.html", **pictures}
