"""What a trade-off leaves: tables of measurements and combinations, the front, and the page."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from pipeline.record import ActionRecord
from styletrf.evaluation.pareto_front import FrontPoint, pareto_front
from styletrf.evaluation.trade_off import Combination, Measurement, Tuning, combinations, merged
from styletrf.files.tables import write_rows, write_summary
from styletrf.reports.trade_off.page import TradeOffContent, write_trade_off_page
from tasks.machine.calibration import calibration_of_machine
from tasks.presets.sweep import Variant, baseline_settings, sweep
from tasks.summary.trade_off_measurements import (
    lineage_of,
    machine,
    measured_on,
    measurement,
    summary_in,
)

STYLE_SIDE = ("", " resemblance", " consistency")
"""How the names of the metrics of a variant of the style continue after its number."""

FIXED_STAGES = ("ConsistencyMetrics", "StyleMetrics", "StylizedTrajectory")
"""Stages after the frames, which take the same time for all variants."""


@dataclass(frozen=True, slots=True)
class MeasuredSweep:
    """The variants of a sweep, and where their artifacts are.

    Attributes:
        scene: The scene.
        style: The painting.
        quality: The preset about which the sweep changes settings.
        tuning: Settings that all variants have.
        device: Where they were computed.
        photographs: The number and the size of the scene's photographs; empty if unknown.
        variants: The variants in the order of their numbers.
        inputs: The folders of their artifacts: those of variant K are `K`, `K resemblance`,
            `K consistency` and `K frames`; `result` and `model` are those of the sweep.
        lineage: The records of all that they were made from.
        command: Returns the main command with some settings and a stylizer.
    """

    scene: str
    style: str
    quality: str
    tuning: Tuning
    device: str
    photographs: Mapping[str, int]
    variants: Sequence[Variant]
    inputs: Mapping[str, Path]
    lineage: Sequence[ActionRecord]
    command: Callable[[Tuning, str], str]

    def measurements(self) -> list[Measurement]:
        """Returns cost and quality of each variant."""
        usual = lineage_of(self.inputs["result"], self.lineage)
        afterwards = {d: r for d, r in usual.items() if r.action.family in FIXED_STAGES}
        return [
            measurement(variant, {**afterwards, **self._own(k)}.values(), self._metrics(k))
            for k, variant in enumerate(self.variants)
        ]

    def _own(self, k: int) -> dict[str, ActionRecord]:
        """Returns the records of a variant's frames and metrics."""
        frames, metrics = self.inputs[f"{k} frames"], self.inputs[f"{k}"]
        return lineage_of(frames, self.lineage) | lineage_of(metrics, self.lineage)

    def _metrics(self, k: int) -> dict[str, Any]:
        folders = [self.inputs.get(f"{k}{name}") for name in STYLE_SIDE]
        return {n: v for folder in folders if folder for n, v in summary_in(folder).items()}

    def description(self) -> dict[str, str]:
        """Returns what was swept, where and when."""
        evidence = json.loads((self.inputs["model"] / "scene.json").read_text())["evidence"]
        return {
            "scene": self.scene, "style": self.style, "quality": self.quality,
            "space": evidence["space"]["chosen"], "machine": machine(self.lineage),
            "measured": measured_on(self.lineage), "changes": self._changes(),
        }  # fmt: skip

    def _changes(self) -> str:
        """Returns how many of the sweep's changes were measured, as text."""
        whole = sweep(baseline_settings(self.quality, self.tuning), 1)
        measured, known = (sum(bool(v.name) for v in each) for each in (self.variants, whole))
        return f"{measured} of {known} changes"


def write_trade_off(out: Path, measured: MeasuredSweep) -> None:
    """Writes `report.html`, `front.json` and the tables of a trade-off.

    Args:
        out: The folder to fill with them: `measurements.parquet`, `combinations.parquet` and
            `front.parquet` are tables.
        measured: The sweep.
    """
    measurements = measured.measurements()
    points = combinations(measurements)
    points = [replace(p, tuning=merged(measured.tuning, p.tuning)) for p in points]
    front = pareto_front(points, measurements)
    write_rows(out / "measurements.parquet", [_flat(asdict(m)) for m in measurements])
    write_rows(out / "combinations.parquet", [_flat(asdict(p)) for p in points])
    rows = [_flat(asdict(p.combination)) | {"overlaps": p.overlaps} for p in front]
    write_rows(out / "front.parquet", rows)
    usual = pareto_front([p for p in points if not p.stylizer], measurements)
    description = measured.description()
    write_summary(out / "front.json", description | _front_file(measured, front, usual))
    content = TradeOffContent(
        **description, points=points, front=front, measurements=measurements,
        command=measured.command,
    )  # fmt: skip
    write_trade_off_page(out / "report.html", content)


def _front_file(
    measured: MeasuredSweep, front: Sequence[FrontPoint], usual: Sequence[FrontPoint]
) -> dict[str, Any]:
    """Returns the points of a front for commands, and what scales their seconds.

    Commands that decide the stylizer themselves need the front of the usual one, too.
    """
    shown: list[Combination] = [p.combination for p in front]
    served = [*front, *(p for p in usual if p.combination not in shown)]
    return {
        "points": [asdict(p) for p in served],
        "calibration": asdict(calibration_of_machine(measured.device)),
        "photographs": measured.photographs,
    }


def _flat(row: dict[str, Any]) -> dict[str, Any]:
    """Returns a row for a table, with its mappings as JSON."""
    return {n: json.dumps(v, sort_keys=True) if isinstance(v, dict) else v for n, v in row.items()}
