"""The whole job for one scene and one style."""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

from pipeline.parameters import BoolParameter
from pipeline.settings import out_root
from pipeline.task import RunContext, StoredTask
from styletrf.errors import InputError
from tasks.command.root_task import root_of_command
from tasks.results.bounded_result import BoundedResult
from tasks.stages.field import RadianceField, TrajectoryFrames
from tasks.stages.metrics import ConsistencyMetrics, QualityMetrics, StyleMetrics
from tasks.stages.scene import CameraPoses, SceneCapture
from tasks.stages.stage import Stage
from tasks.stages.style import StyleImage, StyleNetwork
from tasks.stages.style_parameters import STYLE_AND_PATH_PARAMETERS
from tasks.stages.stylization import StylizedField, StylizedFrames, StylizedPriors
from tasks.summary.gallery import refresh_gallery

PAGES = ("trade-off", "scene-report", "export")
"""Folders in `out/SCENE/` that are not results of a style."""


class StylizedTrajectory(BoundedResult):
    """The stylized fly-through with its report, linked from `out/SCENE/STYLE/`.

    Leaves `report.html`, `poster.png` and `summary.json`. The folder in `out/` links to these and
    to the videos and priors in the store; every run restores it.
    """

    plan = BoolParameter(
        significant=False,
        description="prints which stages exist and which would be built, why, and at what cost;"
        " builds nothing",
    )
    json = BoolParameter(significant=False, description="has --plan print JSON")
    tools = ("av", "opencv-contrib-python-headless")

    def validate(self) -> None:
        """Rejects a style with the name of a page in `out/`.

        Raises:
            InputError: The style has such a name, or the parameters contradict each other.
        """
        super().validate()
        if self.style in PAGES:
            problem = "is the name of a page in out/"
            raise InputError(f"style {self.style}", problem, "Rename the image")

    def stages(self) -> dict[str, Stage]:
        """Returns the stages that the report shows."""
        shown: dict[str, Stage] = {
            "frames": self.upstream(StylizedFrames),
            "trajectory": self.upstream(TrajectoryFrames),
            "style": self.upstream(StyleImage),
            "capture": self.upstream(SceneCapture),
            "poses": self.upstream(CameraPoses),
            "field": self.upstream(RadianceField),
            "quality": self.upstream(QualityMetrics),
            "consistency": self.upstream(ConsistencyMetrics),
            "resemblance": self.upstream(StyleMetrics),
        }
        if self.method == "field":
            shown |= {
                "priors": self.upstream(StylizedPriors),
                "adaptation": self.upstream(StylizedField),
            }
        if self.stylizer == "johnson" or self.method == "per-frame":
            shown["network"] = self.upstream(StyleNetwork)
        return shown

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns the parameters that the report repeats: the main ones, and non-default others."""
        names = ["scene", "style", "quality", "content", "perceptual"]
        names += [name for name in STYLE_AND_PATH_PARAMETERS if not self.is_default(name)]
        return {name: self.param_kwargs[name] for name in names}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Writes the report."""
        from styletrf.files.tables import write_summary
        from styletrf.reports.report import write_report
        from tasks.summary.report_content import report_content, summary_of

        parameters, poster = self.identity_parameters(), out / "poster.png"
        shutil.copyfile(min((inputs["frames"] / "frames").glob("*.png")), poster)
        write_summary(out / "summary.json", summary_of(parameters, inputs, run.lineage))
        write_report(out / "report.html", report_content(parameters, inputs, poster, run.lineage))

    def publish(self, object_path: Path) -> None:
        """Links the result and updates the gallery."""
        super().publish(object_path)
        refresh_gallery(root_of_command())

    @property
    def folder(self) -> Path:
        """Returns the folder of the links."""
        return Path(out_root(), self.scene, self.style)

    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        """Returns the targets of the links: report, numbers, videos, frames and priors."""
        upstream = self.requires()
        own = {name: place(self) / name for name in ("report.html", "summary.json", "poster.png")}
        return own | {
            name: place(upstream[stage]) / file
            for name, (stage, file) in _LINKED.items()
            if stage in upstream
        }


_LINKED = {
    "video.mp4": ("frames", "video.mp4"),
    "frames": ("frames", "frames"),
    "unstylized.mp4": ("trajectory", "video.mp4"),
    "style.png": ("style", "style.png"),
    "priors": ("priors", "frames"),
    "views.parquet": ("quality", "views.parquet"),
    "pairs.parquet": ("consistency", "pairs.parquet"),
    "resemblance.parquet": ("resemblance", "frames.parquet"),
}
"""The links in `out/` to inputs of the report: the input and its file, by the name of the link."""
