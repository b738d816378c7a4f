"""The whole job for one scene and one style."""

import json
import logging
import shutil
from collections.abc import Callable, Generator, Mapping
from pathlib import Path
from typing import cast

import luigi

from pipeline.errors import TaskFailure
from pipeline.parameters import BoolParameter
from pipeline.settings import out_root
from pipeline.task import RunContext, StoredTask, artifact
from styletrf.errors import InputError
from tasks.at_exit import acting_at_exit, root_of_command
from tasks.choosing import Choice, Wish, WishedQuality, choose, space_of, wish_of
from tasks.controls import FrameControls
from tasks.field import RadianceField, TrajectoryFrames
from tasks.graph import graph
from tasks.metrics import ConsistencyMetrics, QualityMetrics, StyleMetrics
from tasks.qualities import QUALITIES
from tasks.scene import CameraPoses, SceneCapture, SceneModel
from tasks.showing import ShownStage
from tasks.sources import is_source
from tasks.stage import Stage, stages_with_settings
from tasks.style import StyleImage, StyleNetwork
from tasks.stylization import StylizedField, StylizedFrames, StylizedPriors
from tasks.wall import refresh_at_exit, refresh_wall

screen = logging.getLogger("pipeline")

PAGES = ("trade-off", "scene-report")
"""Names in `out/SCENE/` that are no style's."""

CONTROLS = (
    "stroke_scale", "content_weight", "transfer", "network", "stylizer", "colors", "strategy",
    "match", "rounds", "method", "strength", "blend", "region",
    "path", "seconds", "frame_rate", "frame_size",
)  # fmt: skip
"""The parameters that steer style and camera, see `tasks.controls` and `tasks.path_controls`."""


class StylizedTrajectory(ShownStage, FrameControls):
    """The stylised fly-through with its report, linked from `out/SCENE/STYLE/`.

    Leaves `report.html`, `poster.png` and `summary.json`; the folder in `out/` links to these and
    to the videos and priors in the store, and is restored by every run.
    """

    quality = WishedQuality(
        choices=list(QUALITIES),
        default="standard",
        description='draft, standard or paper; or "within 0.5 dB": the fastest settings that fall'
        " short of the best by no more, by a measured front",
    )
    budget = luigi.Parameter(
        default="", description="such as 5min: the best settings that take no longer, by a front"
    )
    keep_going = BoolParameter(
        significant=False,
        description="makes what it can where a painting, photographs or weights cannot be used,"
        " instead of stopping",
    )
    tools = ("av", "opencv-contrib-python-headless")
    _is_told = False

    @property
    def wish(self) -> Wish | None:
        """What is wanted of time and accuracy, where that is not a quality by its name."""
        return wish_of(self.quality, self.budget)

    def require_sound(self) -> None:
        """Refuses a wish that cannot be understood.

        Raises:
            InputError: With what to give instead.
        """
        super().require_sound()
        if self.style in PAGES:
            raise InputError(f"style {self.style}", "is the name of a page", "Rename the image")
        if self.budget and not self.is_usual("quality") and self.quality in QUALITIES:
            told = f"--quality {self.quality} --budget {self.budget}"
            raise InputError(told, "ask for settings twice", "Leave one of them out")
        if self.wish and self.tuning:
            problem = "goes without a wish for time or accuracy, which chooses the settings"
            raise InputError(f"--tuning {dict(self.tuning)}", problem, "Leave one of them out")
        if self.wish and (changed := stages_with_settings(graph(self._plain()))):
            problem = "go without a wish for time or accuracy, which chooses them"
            raise InputError(f"settings of {', '.join(changed)}", problem, "Leave one of them out")

    def requires(self) -> Mapping[str, Stage]:
        """Everything the report shows; to choose settings, the kind of scene and the sources."""
        if self.wish:
            sources = [task for task in graph(self._plain()) if is_source(task)]
            named = {task.task_family: cast("Stage", task) for task in sources}
            return {"model": self.need(SceneModel, quality=QUALITIES[0]), **named}
        shown: dict[str, Stage] = {
            "frames": self.need(StylizedFrames),
            "trajectory": self.need(TrajectoryFrames),
            "style": self.need(StyleImage),
            "capture": self.need(SceneCapture),
            "poses": self.need(CameraPoses),
            "field": self.need(RadianceField),
            "quality": self.need(QualityMetrics),
            "consistency": self.need(ConsistencyMetrics),
            "resemblance": self.need(StyleMetrics),
        }
        if self.method == "field":
            shown |= {"priors": self.need(StylizedPriors), "adaptation": self.need(StylizedField)}
        if self.stylizer == "johnson" or self.method == "per-frame":
            shown["network"] = self.need(StyleNetwork)
        return shown

    def identity_parameters(self) -> Mapping[str, object]:
        """The words of the command, which the report repeats: the first ones, and the unusual."""
        first = ("scene", "style", "quality", "content", "perceptual")
        return {name: self.param_kwargs[name] for name in first} | {
            name: self.param_kwargs[name] for name in CONTROLS if not self.is_usual(name)
        }

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Write the report."""
        from styletrf.files.tables import write_summary
        from styletrf.reports.report import write_report
        from tasks.reporting import report_content, summary_of

        words, poster = self.identity_parameters(), out / "poster.png"
        shutil.copyfile(min((inputs["frames"] / "frames").glob("*.png")), poster)
        write_summary(out / "summary.json", summary_of(words, inputs, run.lineage))
        write_report(out / "report.html", report_content(words, inputs, poster, run.lineage))

    def cells(self) -> "list[StylizedTrajectory]":
        """The results asked for."""
        return [self.granted() or self]

    def _plain(self) -> "StylizedTrajectory":
        """The same at the first quality; any quality needs the same photographs and painting."""
        return StylizedTrajectory(**{**self.param_kwargs, "quality": QUALITIES[0], "budget": ""})

    def complete(self) -> bool:
        """Whether the result is in the store and in `out/`; the command refreshes the index."""
        with acting_at_exit(self, refresh_at_exit):
            granted = self.granted()
            return granted.complete() if granted else super().complete()

    def run(self) -> "Generator[StoredTask, None, None] | None":
        """Make the result; for a wish, have Luigi make the one that grants it."""
        return self._grant() if self.wish else super().run()

    def _grant(self) -> "Generator[StoredTask, None, None]":
        try:
            self._choice()
        except InputError as error:
            raise TaskFailure("user", str(self), str(error)) from error
        yield cast("StoredTask", self.granted())

    def granted(self) -> "StylizedTrajectory | None":
        """The result that grants the wish.

        None without a wish; while the kind of scene is unknown; and where no result will do, which
        `require_sound` or `run` tell.
        """
        try:
            self.require_sound()
            if not self.wish or not self.requires()["model"].complete():
                return None
            choice = self._choice()
        except InputError:
            return None
        if not self._is_told:
            self._is_told = True
            screen.info("%s: %s", self.label, choice.told)
        found = {**self.param_kwargs, "quality": choice.quality, "tuning": choice.point.tuning}
        return StylizedTrajectory(**{**found, "budget": ""})

    def _choice(self) -> Choice:
        model = json.loads((artifact(self.requires()["model"]) / "scene.json").read_text())
        measured = out_root() / self.scene / "trade-off" / "front.json"
        return choose(cast("Wish", self.wish), measured, space_of(model))

    def publish(self, object_path: Path) -> None:
        """Make the links, and have the index show the result."""
        super().publish(object_path)
        refresh_wall(root_of_command())

    @property
    def folder(self) -> Path:
        """Where the result is shown."""
        return Path(out_root(), self.scene, self.style)

    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        """The page, its numbers, and the videos, frames and priors it shows."""
        object_path = place(self)
        upstream = self.requires()
        painted = {"priors": place(upstream["priors"]) / "frames"} if "priors" in upstream else {}
        return painted | {
            "report.html": object_path / "report.html",
            "summary.json": object_path / "summary.json",
            "poster.png": object_path / "poster.png",
            "video.mp4": place(upstream["frames"]) / "video.mp4",
            "frames": place(upstream["frames"]) / "frames",
            "unstylized.mp4": place(upstream["trajectory"]) / "video.mp4",
            "style.png": place(upstream["style"]) / "style.png",
            "views.parquet": place(upstream["quality"]) / "views.parquet",
            "pairs.parquet": place(upstream["consistency"]) / "pairs.parquet",
            "resemblance.parquet": place(upstream["resemblance"]) / "frames.parquet",
        }
