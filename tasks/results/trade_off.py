"""The speed/quality trade-off: variants measured one by one, and their best combinations."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import luigi

from pipeline.maintenance.task_graph import upstream_first
from pipeline.parameters import IntParameter, ListParameter
from pipeline.record import ActionRecord
from pipeline.settings import data_root, out_root
from pipeline.task import RunContext, StoredTask
from styletrf.errors import InputError
from styletrf.evaluation.trade_off import Measurement, Tuning, merged
from tasks.command.main_command import main_command
from tasks.machine.calibration import calibration_of_machine
from tasks.planning.scene_sizes import sizes_of
from tasks.presets.sweep import Variant, baseline_settings, sweep
from tasks.results.trajectory import StylizedTrajectory
from tasks.stages.field import TrajectoryFrames
from tasks.stages.linked_results import LinkedStage
from tasks.stages.metrics import (
    ConsistencyMetrics,
    QualityMetrics,
    StyleMetrics,
    StylizationMetrics,
)
from tasks.stages.scene import SceneModel
from tasks.stages.stage import PresetStage, Stage, stages_with_settings
from tasks.summary.trade_off_measurements import (
    lineage_of,
    machine,
    measured_on,
    measurement,
    summary_in,
)


class TradeOff(LinkedStage, PresetStage):
    """The Pareto front of time and quality of a scene, from a sweep around a preset.

    Its points are ordinary stages in the store, measured one after the other. Run it on an idle
    machine with one worker. Leaves `report.html`, `measurements.parquet`,
    `combinations.parquet`, `front.parquet`, and `front.json`, which `--quality "within 0.5 dB"` and
    `--budget` of the main command read; linked from `out/SCENE/trade-off/`.
    """

    scene = luigi.Parameter(description="a folder in data/scenes")
    style = luigi.Parameter(
        default="", description="an image in data/styles; the first one if empty"
    )
    content = StylizedTrajectory.content
    perceptual = StylizedTrajectory.perceptual
    repeats = IntParameter(
        default=3, description="number of measurements of the baseline, for the spread"
    )
    only: Any = ListParameter(
        default=(), description='only these changes, such as ["iterations x 0.5"]'
    )
    tools = ()
    uses_device = True  # for the calibration

    def validate(self) -> None:
        """Rejects a sweep without a baseline, or with unknown changes.

        Raises:
            InputError: Fewer than one repeat, or an unknown change.
        """
        super().validate()
        if self.repeats < 1:
            raise InputError(f"--repeats {self.repeats}", "is below 1", "Give 1 or more")
        if changed := stages_with_settings(upstream_first(self)):
            subject = f"settings of {', '.join(changed)}"
            raise InputError(subject, "would hide what a sweep changes", "Give them by --tuning")
        names = [v.name for v in sweep(baseline_settings(self.quality, self.tuning), 1) if v.name]
        if unknown := set(self.only) - set(names):
            subject = f"--only {sorted(unknown)}"
            raise InputError(subject, "is not a change of the sweep", f"Give some of {names}")

    def variants(self) -> list[Variant]:
        """Returns the variants to measure."""
        found = sweep(baseline_settings(self.quality, self.tuning), self.repeats)
        return [v for v in found if not (self.only and v.name) or v.name in self.only]

    def requires(self) -> Mapping[str, Stage]:
        """Returns the stages of all variants, and the result.

        Those of variant K are `K`, `K resemblance`, `K consistency` and `K frames`.
        """
        painting: dict[str, Any] = {"style": self.painting}
        needed: dict[str, Stage] = {"result": self.upstream(StylizedTrajectory, **painting)}
        needed["model"] = self.upstream(SceneModel)
        for k, variant in enumerate(self.variants()):
            tuning = merged(self.tuning, variant.tuning)
            if variant.part == "scene":
                needed[f"{k}"] = self.upstream(QualityMetrics, tuning=tuning)
            else:
                parameters = {**painting, "tuning": tuning}
                parameters |= {"stylizer": variant.stylizer} if variant.stylizer else {}
                needed[f"{k}"] = self.upstream(StylizationMetrics, **parameters)
                needed[f"{k} resemblance"] = self.upstream(StyleMetrics, **parameters)
                needed[f"{k} consistency"] = self.upstream(ConsistencyMetrics, **parameters)
            needed[f"{k} frames"] = self.upstream(TrajectoryFrames, tuning=tuning)
        return needed

    @property
    def painting(self) -> str:
        """Returns the style's name."""
        from styletrf.capture.user_folders import first_style

        return self.style or first_style(data_root())

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns the parameters that the page and its commands repeat."""
        names = ("scene", "quality", "content", "perceptual", "repeats", "only", "tuning")
        return {"style": self.painting} | {name: self.param_kwargs[name] for name in names}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Gathers cost and quality of the stages, and finds the front."""
        from styletrf.evaluation.pareto_front import pareto_front
        from styletrf.evaluation.trade_off import combinations
        from styletrf.files.tables import write_rows, write_summary
        from styletrf.reports.trade_off_page import TradeOffContent, write_trade_off_page

        measured = self._measurements(inputs, run.lineage)
        points = combinations(measured)
        points = [replace(p, tuning=merged(self.tuning, p.tuning)) for p in points]
        front = pareto_front(points, measured)
        write_rows(out / "measurements.parquet", [_flat(asdict(m)) for m in measured])
        write_rows(out / "combinations.parquet", [_flat(asdict(p)) for p in points])
        usual = pareto_front([p for p in points if not p.stylizer], measured)
        shown = [p.combination for p in front]  # commands that decide the stylizer need the others
        served = [*front, *(p for p in usual if p.combination not in shown)]
        rows = [_flat(asdict(p.combination)) | {"overlaps": p.overlaps} for p in front]
        write_rows(out / "front.parquet", rows)
        evidence = json.loads((inputs["model"] / "scene.json").read_text())["evidence"]
        description = {
            "scene": self.scene, "style": self.painting, "quality": self.quality,
            "space": evidence["space"]["chosen"], "machine": machine(run.lineage),
            "measured": measured_on(run.lineage), "changes": self._changes(),
        }  # fmt: skip
        photographs = sizes_of((self.scene,)).get(self.scene)
        measured_front = {
            "points": [asdict(p) for p in served],
            "calibration": asdict(calibration_of_machine(self.device)),
            "photographs": asdict(photographs) if photographs else {},
        }
        write_summary(out / "front.json", {**description, **measured_front})
        content = TradeOffContent(**description, points=points, front=front, measurements=measured,
                                  command=self.command)  # fmt: skip
        write_trade_off_page(out / "report.html", content)

    def _changes(self) -> str:
        """Returns how many of the sweep's changes were measured, as text."""
        measured, whole = (
            sum(bool(v.name) for v in each)
            for each in (self.variants(), sweep(baseline_settings(self.quality, self.tuning), 1))
        )
        return f"{measured} of {whole} changes"

    def command(self, tuning: Tuning, stylizer: str = "") -> str:
        """Returns the main command with these settings."""
        parameters = {"scene": self.scene, "style": self.painting, "quality": self.quality}
        parameters |= {"stylizer": stylizer} if stylizer else {}
        for name in ("content", "perceptual"):
            if not self.is_default(name):
                parameters[name] = self.param_kwargs[name]
        return main_command(parameters, tuning)

    def _measurements(
        self, inputs: Mapping[str, Path], records: Sequence[ActionRecord]
    ) -> list[Measurement]:
        usual = lineage_of(inputs["result"], records)
        afterwards = {digest: r for digest, r in usual.items() if r.action.family in FIXED_STAGES}
        return [
            measurement(
                variant,
                (
                    afterwards
                    | lineage_of(inputs[f"{k} frames"], records)
                    | lineage_of(inputs[f"{k}"], records)
                ).values(),
                self._metrics_of(inputs, k),
            )
            for k, variant in enumerate(self.variants())
        ]

    @staticmethod
    def _metrics_of(inputs: Mapping[str, Path], k: int) -> dict[str, Any]:
        """Returns the metrics of a variant."""
        metrics = [f"{k}{name}" for name in STYLE_SIDE]
        return {n: v for m in metrics if m in inputs for n, v in summary_in(inputs[m]).items()}

    @property
    def folder(self) -> Path:
        """Returns the folder of the links."""
        return Path(out_root(), self.scene, "trade-off")

    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        """Returns the targets of the links: the page and its tables."""
        names = ("report.html", "front.json", "front.parquet", "combinations.parquet")
        return {name: place(self) / name for name in (*names, "measurements.parquet")}


STYLE_SIDE = ("", " resemblance", " consistency")
"""How the names of the metrics of a variant of the style continue after its number."""

FIXED_STAGES = ("ConsistencyMetrics", "StyleMetrics", "StylizedTrajectory")
"""Stages after the frames, which take the same time for all variants."""


def _flat(row: dict[str, Any]) -> dict[str, Any]:
    """Returns a row for a table, with its mappings as JSON."""
    return {n: json.dumps(v, sort_keys=True) if isinstance(v, dict) else v for n, v in row.items()}
