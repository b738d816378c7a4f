"""The speed/quality trade-off: variants measured one by one, and their best combinations."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pipeline.maintenance.task_graph import upstream_first
from pipeline.parameters import IntParameter, ListParameter, NameParameter
from pipeline.settings import data_root, out_root
from pipeline.task import RunContext, StoredTask
from styletrf.errors import InputError
from styletrf.evaluation.trade_off import Tuning, merged
from tasks.command.main_command import main_command
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


class TradeOff(LinkedStage, PresetStage):
    """The Pareto front of time and quality of a scene, from a sweep around a preset.

    Its points are ordinary stages in the store, measured one after the other. Run it on an idle
    machine with one worker. Leaves `report.html`, `measurements.parquet`,
    `combinations.parquet`, `front.parquet`, and `front.json`, which `--quality "within 0.5 dB"` and
    `--budget` of the main command read; linked from `out/SCENE/trade-off/`.
    """

    scene = NameParameter(description="a folder in data/scenes")
    style = NameParameter(default="", description="an image in data/styles; the first one if empty")
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
        from tasks.summary.trade_off_content import MeasuredSweep, write_trade_off

        sizes = sizes_of((self.scene,)).get(self.scene)
        measured = MeasuredSweep(
            self.scene, self.painting, self.quality, self.tuning, self.device,
            asdict(sizes) if sizes else {}, self.variants(), inputs, run.lineage, self.command,
        )  # fmt: skip
        write_trade_off(out, measured)

    def command(self, tuning: Tuning, stylizer: str = "") -> str:
        """Returns the main command with these settings."""
        parameters = {"scene": self.scene, "style": self.painting, "quality": self.quality}
        parameters |= {"stylizer": stylizer} if stylizer else {}
        for name in ("content", "perceptual"):
            if not self.is_default(name):
                parameters[name] = self.param_kwargs[name]
        return main_command(parameters, tuning)

    @property
    def folder(self) -> Path:
        """Returns the folder of the links."""
        return Path(out_root(), self.scene, "trade-off")

    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        """Returns the targets of the links: the page and its tables."""
        names = ("report.html", "front.json", "front.parquet", "combinations.parquet")
        return {name: place(self) / name for name in (*names, "measurements.parquet")}
