"""The report on a scene's photographs, before hours are spent on them."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pipeline.parameters import NameParameter
from pipeline.settings import out_root
from pipeline.task import RunContext, StoredTask
from styletrf.errors import InputError
from tasks.machine.calibration import this_machine
from tasks.presets.presets import PRESETS
from tasks.results.job_costs import job_costs
from tasks.stages.linked_results import LinkedStage
from tasks.stages.scene import CameraPoses, SceneCapture, SceneModel
from tasks.stages.stage import ConfigurableStage, PresetStage, Stage

FITTED = ("SceneModel", "RadianceField")
"""The stages that the report runs itself, with the settings of each quality."""
TRIED = ("draft", "standard")  # brief fits of `paper` take a quarter of an hour or more on cores


class SceneReport(LinkedStage, PresetStage):
    """A page about a scene: cameras, coverage, outliers, the model, the time and PSNR to expect.

    Leaves `report.html` and `summary.json`, linked from `out/SCENE/scene-report/`.
    """

    scene = NameParameter(description="a folder in data/scenes, or a video there")
    tools = ("numba", "opencv-contrib-python-headless", "torch")
    uses_device = True

    def validate(self) -> None:
        """Rejects settings of stages that the report would not obey.

        Raises:
            InputError: The settings are given by `--STAGE-settings`.
        """
        super().validate()
        for family in FITTED:
            if ConfigurableStage.settings.task_value(family, "settings"):
                problem = "does not reach the brief fits of the report"
                raise InputError(f"--{family}-settings", problem, "Give them by --tuning")

    def requires(self) -> Mapping[str, Stage]:
        """Returns the photographs, their cameras, and the model of the requested quality."""
        return {
            "capture": self.upstream(SceneCapture),
            "poses": self.upstream(CameraPoses),
            "model": self.upstream(SceneModel),
        }

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns the scene's name, which the page repeats, and the settings of `--tuning`."""
        return {"scene": self.scene} | ({"tuning": self.tuning} if self.tuning else {})

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Surveys the photographs, fits brief fields at `draft` and `standard`, and writes."""
        from styletrf.steps.scene_report import report_scene

        report_scene(
            inputs,
            out,
            {},
            self.step_run(run),
            scene=self.scene,
            jobs=self._jobs(),
            machine=this_machine(self.device).description,
        )

    def _jobs(self) -> Mapping[str, Any]:
        """Returns the `PlannedJob` of each quality that the page compares."""
        from styletrf.steps.scene_report import PlannedJob

        costs = job_costs(self.scene, self.device, PRESETS, self.tuning)
        return {
            quality: PlannedJob(
                cost.seconds - cost.field_seconds,
                cost.field_seconds,
                cost.peak_memory_bytes,
                cost.output_bytes,
                self.tuned("SceneModel", quality),
                self.tuned("RadianceField", quality),
                quality in TRIED,
            )
            for quality, cost in costs.items()
        }

    @property
    def folder(self) -> Path:
        """Returns the folder of the links."""
        return Path(out_root(), self.scene, "scene-report")

    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        """Returns the targets of the links: the page and its numbers."""
        return {name: place(self) / name for name in ("report.html", "summary.json")}
