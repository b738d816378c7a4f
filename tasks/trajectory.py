"""The whole job for one scene and one style."""

import json
import logging
import shutil
from collections.abc import Callable, Generator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import cast

import luigi

from pipeline.errors import TaskFailure
from pipeline.parameters import BoolParameter
from pipeline.settings import out_root
from pipeline.task import RunContext, StoredTask, artifact
from styletrf.errors import InputError
from styletrf.evaluation.trade_off import Tuning
from tasks.build_order import is_made
from tasks.controls import FrameControls
from tasks.field import RadianceField, TrajectoryFrames
from tasks.graph import graph, root_of_command
from tasks.kept_choice import choice_for, keep_choice, known_choice
from tasks.metrics import ConsistencyMetrics, QualityMetrics, StyleMetrics
from tasks.qualities import QUALITIES
from tasks.quality_choice import (
    Choice,
    Front,
    fronts_for,
    possible_choices,
    require_reachable,
    space_of,
)
from tasks.quality_request import QualityParameter, QualityRequest, quality_request
from tasks.remaining_time import timing_of
from tasks.scene import CameraPoses, SceneCapture, SceneModel
from tasks.showing import ShownStage
from tasks.sources import is_source
from tasks.stage import Stage, stages_with_settings
from tasks.style import StyleImage, StyleNetwork
from tasks.stylization import StylizedField, StylizedFrames, StylizedPriors
from tasks.wall import refresh_wall

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

    quality = QualityParameter(
        choices=list(QUALITIES),
        default="standard",
        description='draft, standard or paper; or "within 0.5 dB": the fastest settings that fall'
        " short of the best by no more, by a measured front",
    )
    budget = luigi.Parameter(
        default="",
        description="such as 5min: the best settings that take no longer on this machine, by a"
        " measured front",
    )
    plan = BoolParameter(
        significant=False,
        description="prints what is found and what would be made, why, and at what cost; builds"
        " nothing",
    )
    json = BoolParameter(significant=False, description="has --plan print JSON")
    keep_going = BoolParameter(
        significant=False,
        description="makes what it can where a painting, photographs or weights cannot be used,"
        " instead of stopping",
    )
    tools = ("av", "opencv-contrib-python-headless")

    @property
    def request(self) -> QualityRequest | None:
        """What is asked of time and accuracy, where that is not a quality by its name."""
        return quality_request(self.quality, self.budget)

    def require_sound(self) -> None:
        """Refuses a request for time or accuracy that is unclear, or goes with settings.

        Raises:
            InputError: With what to give instead.
        """
        super().require_sound()
        if self.style in PAGES:
            raise InputError(f"style {self.style}", "is the name of a page", "Rename the image")
        if self.json and not self.plan:
            raise InputError("--json", "is for --plan alone", "Add --plan, or leave it out")
        if self.budget and not self.is_usual("quality") and self.quality in QUALITIES:
            subject = f"--quality {self.quality} --budget {self.budget}"
            raise InputError(subject, "ask for settings twice", "Leave one of them out")
        if self.request and self.tuning:
            problem = "does not go with a bound on time or accuracy, which chooses the settings"
            raise InputError(f"--tuning {dict(self.tuning)}", problem, "Leave one of them out")
        if self.request and (changed := stages_with_settings(graph(self._plain()))):
            problem = "do not go with a bound on time or accuracy, which chooses them"
            raise InputError(f"settings of {', '.join(changed)}", problem, "Leave one of them out")

    def require_reachable(self) -> None:
        """Refuses a budget below what the fastest settings take, before the first stage.

        Of the fronts that may apply to the scene the fastest point counts, until it is known which
        front does. What is in the store takes no time.

        Raises:
            InputError: It names the nearest budget that can be reached.
        """
        if self.request and not self.resolved():
            fronts = fronts_for(self._measured_front(), self._space())
            require_reachable(self.request, fronts, timing_of(self))

    def requires(self) -> Mapping[str, Stage]:
        """Everything the report shows; to choose settings, the kind of scene and the sources."""
        if self.request:
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
        return [self.resolved() or self]

    def _plain(self) -> "StylizedTrajectory":
        """The same at the first quality; any quality needs the same photographs and painting."""
        return self.with_settings(QUALITIES[0], {})

    def with_settings(self, quality: str, tuning: Tuning) -> "StylizedTrajectory":
        """Returns the same fly-through at a quality by its name, with settings of stages."""
        words = {**self.param_kwargs, "quality": quality, "tuning": tuning, "budget": ""}
        return StylizedTrajectory(**words)

    def complete(self) -> bool:
        """Whether the result is in the store and in `out/`; for a request, that chosen for it."""
        resolved = self.resolved()
        return resolved.complete() if resolved else super().complete()

    def run(self) -> "Generator[StoredTask, None, None] | None":
        """Make the result; for a request, have Luigi make the one with the chosen settings."""
        return self._run_resolved() if self.request else super().run()

    def _run_resolved(self) -> "Generator[StoredTask, None, None]":
        try:
            choice = self._keep_choice()
        except InputError as error:
            raise TaskFailure("user", str(self), str(error)) from error
        yield self.with_settings(choice.quality, choice.point.tuning)

    def resolved(self) -> "StylizedTrajectory | None":
        """The result with the settings that were chosen for a request for time or accuracy.

        None without a request; before `choose_settings` or `run` choose; and where no settings
        will do, which `require_reachable` or `run` report.
        """
        try:
            if not self.request:
                return None
            self.require_sound()
            if not self._space():
                return None
            choice = known_choice(self, self.request, self._front())
        except InputError:
            return None
        return self.with_settings(choice.quality, choice.point.tuning) if choice else None

    def choose_settings(self) -> None:
        """For a request, chooses the settings if the kind of scene is known, and keeps them.

        It may measure how fast the machine is. Without settings that will do it chooses none.
        """
        with suppress(InputError):
            if self.request:
                self.require_sound()
                if self._space():
                    self._keep_choice()

    def planned(self) -> "tuple[StylizedTrajectory, str]":
        """Returns what `--plan` describes, and how its settings were chosen.

        While it is not known which front applies, of those that may the one that takes longest.

        Raises:
            InputError: No settings will do.
        """
        if not self.request:
            return self, ""
        if self._space():
            choice = self._choice()
            return self.with_settings(choice.quality, choice.point.tuning), choice.description
        fronts, timing = fronts_for(self._measured_front(), None), timing_of(self)
        require_reachable(self.request, fronts, timing)
        choices = possible_choices(self.request, fronts, timing)
        choice = max(choices, key=lambda c: c.point.seconds)
        description = f"while the kind of space is unknown, supposing {choice.description}"
        return self.with_settings(choice.quality, choice.point.tuning), description

    def _keep_choice(self) -> Choice:
        """Chooses the settings of a request, and keeps them for the next command.

        Raises:
            InputError: No settings will do.
        """
        choice = self._choice()
        keep_choice(self, self._front(), choice)
        screen.info("%s: %s", self.label, choice.description)
        return choice

    def _choice(self) -> Choice:
        return choice_for(self, cast("QualityRequest", self.request), self._front())

    def _front(self) -> Front:
        return fronts_for(self._measured_front(), self._space())[0]

    def _measured_front(self) -> Path:
        return Path(out_root(), self.scene, "trade-off", "front.json")

    def _space(self) -> str | None:
        """The kind of the scene's space; None before it is decided."""
        model = self.requires()["model"]
        if not is_made(model):
            return None
        return space_of(json.loads((artifact(model) / "scene.json").read_text()))

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
