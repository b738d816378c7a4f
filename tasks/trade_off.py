"""What accuracy costs: variants measured one by one, and the best combinations of them."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import luigi

from pipeline.parameters import IntParameter, ListParameter
from pipeline.record import ActionRecord
from pipeline.settings import data_root, out_root
from pipeline.task import RunContext, StoredTask
from styletrf.errors import InputError
from styletrf.evaluation.trade_off import Measurement, Tuning, merged
from tasks.command import main_command
from tasks.field import TrajectoryFrames
from tasks.graph import graph
from tasks.machine_calibration import calibration_of_machine
from tasks.measuring import lineage_of, measurement, summary_in
from tasks.metrics import QualityMetrics, StyleMetrics, StylizationMetrics
from tasks.scene import SceneModel
from tasks.showing import ShownStage
from tasks.stage import GradedStage, Stage, stages_with_settings
from tasks.sweep import Variant, middle_of, sweep
from tasks.trajectory import StylizedTrajectory


class TradeOff(ShownStage, GradedStage):
    """The front of time and accuracy of a scene: a sweep over the knobs around a quality.

    Its points are ordinary stages in the store, measured one after the other; run it on a machine
    that does nothing else, with one worker. Leaves `report.html`, `measurements.parquet`,
    `combinations.parquet`, `front.parquet`, and `front.json`, which `--quality "within 0.5 dB"` and
    `--budget` of the main command read; linked from `out/SCENE/trade-off/`.
    """

    scene = luigi.Parameter(description="a folder in data/scenes")
    style = luigi.Parameter(
        default="", description="an image in data/styles; without a name, the first of them"
    )
    content = StylizedTrajectory.content
    perceptual = StylizedTrajectory.perceptual
    repeats = IntParameter(
        default=3, description="how often the unchanged quality is measured, for the spread"
    )
    only: Any = ListParameter(
        default=(), description='some of the changes, such as ["iterations x 0.5"], instead of all'
    )
    tools = ()

    def require_sound(self) -> None:
        """Refuses a sweep without a middle, or of changes that it does not know.

        Raises:
            InputError: Fewer than one repeat, or a name that is no change's.
        """
        super().require_sound()
        if self.repeats < 1:
            raise InputError(f"--repeats {self.repeats}", "measures nothing", "Give 1 or more")
        if changed := stages_with_settings(graph(self)):
            subject = f"settings of {', '.join(changed)}"
            raise InputError(subject, "would hide what a sweep changes", "Give them by --tuning")
        names = [v.name for v in sweep(middle_of(self.quality, self.tuning), 1) if v.name]
        if unknown := set(self.only) - set(names):
            subject = f"--only {sorted(unknown)}"
            raise InputError(subject, "is no change of the sweep", f"Give some of {names}")

    def variants(self) -> list[Variant]:
        """What is measured."""
        found = sweep(middle_of(self.quality, self.tuning), self.repeats)
        return [v for v in found if not (self.only and v.name) or v.name in self.only]

    def requires(self) -> Mapping[str, Stage]:
        """The stages that measure variant K: `K`, `K resemblance`, `K frames`; and the result."""
        painting = {"style": self.painting}
        needed: dict[str, Stage] = {"result": self.need(StylizedTrajectory, **painting)}
        needed["model"] = self.need(SceneModel)
        for k, variant in enumerate(self.variants()):
            tuning = merged(self.tuning, variant.tuning)
            needed[f"{k}"] = (
                self.need(QualityMetrics, tuning=tuning)
                if variant.part == "scene"
                else self.need(StylizationMetrics, tuning=tuning, **painting)
            )
            if variant.part == "style":
                needed[f"{k} resemblance"] = self.need(StyleMetrics, tuning=tuning, **painting)
            needed[f"{k} frames"] = self.need(TrajectoryFrames, tuning=tuning)
        return needed

    @property
    def painting(self) -> str:
        """The style's name."""
        from styletrf.capture.user_folders import first_style

        return self.style or first_style(data_root())

    def identity_parameters(self) -> Mapping[str, object]:
        """The words that the page and its commands repeat."""
        names = ("scene", "quality", "content", "perceptual", "repeats", "only", "tuning")
        return {"style": self.painting} | {name: self.param_kwargs[name] for name in names}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Gather what the stages took and achieved, and find the front."""
        from styletrf.evaluation.pareto_front import pareto_front
        from styletrf.evaluation.trade_off import combinations
        from styletrf.files.tables import write_rows, write_summary
        from styletrf.reports.trade_off_page import TradeOffContent, write_trade_off_page
        from tasks.measuring import machine, measured_on

        measured = self._measurements(inputs, run.lineage)
        points = combinations(measured)
        points = [replace(p, tuning=merged(self.tuning, p.tuning)) for p in points]
        front = pareto_front(points, measured)
        write_rows(out / "measurements.parquet", [_flat(asdict(m)) for m in measured])
        write_rows(out / "combinations.parquet", [_flat(asdict(p)) for p in points])
        rows = [_flat(asdict(p.combination)) | {"overlaps": p.overlaps} for p in front]
        write_rows(out / "front.parquet", rows)
        evidence = json.loads((inputs["model"] / "scene.json").read_text())["evidence"]
        description = {
            "scene": self.scene, "style": self.painting, "quality": self.quality,
            "space": evidence["space"]["chosen"], "machine": machine(run.lineage),
            "measured": measured_on(run.lineage), "changes": self._changes(),
        }  # fmt: skip
        calibration = asdict(calibration_of_machine(self.device))
        measured_front = {"points": [asdict(p) for p in front], "calibration": calibration}
        write_summary(out / "front.json", {**description, **measured_front})
        content = TradeOffContent(**description, points=points, front=front, measurements=measured,
                                  command=self.command)  # fmt: skip
        write_trade_off_page(out / "report.html", content)

    def _changes(self) -> str:
        """How many of the sweep's changes were measured, in words."""
        measured, whole = (
            sum(bool(v.name) for v in each)
            for each in (self.variants(), sweep(middle_of(self.quality, self.tuning), 1))
        )
        return f"{measured} of {whole} changes"

    def command(self, tuning: Tuning) -> str:
        """Returns the main command with these settings."""
        words = {"scene": self.scene, "style": self.painting, "quality": self.quality}
        for name in ("content", "perceptual"):
            if not self.is_usual(name):
                words[name] = self.param_kwargs[name]
        return main_command(words, tuning)

    def _measurements(
        self, inputs: Mapping[str, Path], records: Sequence[ActionRecord]
    ) -> list[Measurement]:
        usual = lineage_of(inputs["result"], records)
        afterwards = {digest: r for digest, r in usual.items() if r.action.family in _AFTERWARDS}
        return [
            measurement(
                variant,
                (
                    afterwards
                    | lineage_of(inputs[f"{k} frames"], records)
                    | lineage_of(inputs[f"{k}"], records)
                ).values(),
                self._judged(inputs, k),
            )
            for k, variant in enumerate(self.variants())
        ]

    @staticmethod
    def _judged(inputs: Mapping[str, Path], k: int) -> dict[str, Any]:
        """What was measured of a variant."""
        judges = (f"{k}", f"{k} resemblance")
        return {n: v for j in judges if j in inputs for n, v in summary_in(inputs[j]).items()}

    @property
    def folder(self) -> Path:
        """Where the result is shown."""
        return Path(out_root(), self.scene, "trade-off")

    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        """The page and its tables."""
        names = ("report.html", "front.json", "front.parquet", "combinations.parquet")
        return {name: place(self) / name for name in (*names, "measurements.parquet")}


_AFTERWARDS = ("ConsistencyMetrics", "StyleMetrics", "StylizedTrajectory")
"""What the main command does once the frames are there, whatever the variant."""


def _flat(row: dict[str, Any]) -> dict[str, Any]:
    """A row of a table: mappings as JSON."""
    return {n: json.dumps(v, sort_keys=True) if isinstance(v, dict) else v for n, v in row.items()}
