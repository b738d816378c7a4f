"""Predicts the cost of a stage on this machine by its earlier builds, or else by a reference.

The reference is a draft of one scene, measured stage by stage on a machine whose calibration is
known (`reference_costs.json`, written by `benchmarks/reference_costs.py`). Either is scaled by the
work of the stage (`tasks.planning.stage_work`), the reference by the machine as well.
"""

import functools
import json
import socket
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any, Literal

import luigi
from luigi.task_register import Register

from pipeline.execution.cost_history import Cost, CostSample, cost_history, most_similar
from pipeline.execution.resources import significant
from pipeline.settings import current_store
from pipeline.task import StoredTask
from tasks.machine.calibration import Calibration
from tasks.planning.memory_demand import GROWTH, Photographs, predicted_bytes
from tasks.planning.stage_demands import demand_name, demand_of
from tasks.planning.stage_drivers import drivers_of
from tasks.planning.stage_work import (
    START_S,
    WHOLE_FIT,
    added_seconds,
    is_comparable,
    seconds_scaled,
    work_of,
    work_ratio,
)
from tasks.stages.field import RadianceField
from tasks.stages.stage import ConfigurableStage

REFERENCE = Path(__file__).with_name("reference_costs.json")
Evidence = Literal["this machine", "the front", "the reference"]
Sizes = Mapping[str, Photographs]


@dataclass(frozen=True, slots=True)
class ExpectedCost:
    """The expected cost of a stage, and the evidence for it.

    Attributes:
        seconds: The seconds of the build, with all cores of the machine.
        cpu_seconds: The CPU seconds of all cores together.
        peak_memory_bytes: The peak memory of its processes.
        output_bytes: The bytes of the artifact on disk.
        evidence: Builds on this machine, the front that the settings are from, or the reference.
    """

    seconds: float
    cpu_seconds: float
    peak_memory_bytes: int
    output_bytes: int
    evidence: Evidence


@dataclass(frozen=True, slots=True)
class ReferenceCosts:
    """The costs of a draft, stage by stage, on a machine of a known calibration.

    Attributes:
        scene: Its name, which is of no scene here.
        photographs: The photographs of that scene.
        calibration: The calibration of that machine; None if the times are to be taken as they are.
        stages: The cost of each family.
    """

    scene: str
    photographs: Photographs
    calibration: Calibration
    stages: Mapping[str, Cost]

    def stage_like(self, stage: luigi.Task) -> luigi.Task:
        """Returns the stage of the reference that a stage is compared with."""
        kind = RadianceField if work_of(stage) == WHOLE_FIT else type(stage)
        return plain_stage(kind, scene=self.scene, style="reference", quality="draft")


def plain_stage(kind: type[luigi.Task], **parameters: Any) -> luigi.Task:
    """Returns a stage with those of the parameters that it has; others have their defaults."""
    names = {name for name, _ in kind.get_params()}  # type: ignore[no-untyped-call]
    given = {**parameters, "settings": {}}  # a command's settings are otherwise the default
    return kind(**{name: value for name, value in given.items() if name in names})


@functools.cache
def reference_costs() -> ReferenceCosts:
    """Returns the reference that is shipped."""
    fields: dict[str, Any] = json.loads(REFERENCE.read_text())
    return ReferenceCosts(
        scene=f"the reference {fields['scene']}",
        photographs=Photographs(**fields["photographs"]),
        calibration=Calibration.from_json(fields["calibration"]),
        stages={family: Cost(**cost) for family, cost in fields["stages"].items()},
    )


@dataclass(frozen=True, slots=True)
class MeasuredSeconds:
    """The seconds of a stage of a front, and where they were measured.

    Attributes:
        seconds: The seconds with the settings of a point.
        stage: The stage that took them: with the settings of the point, and all else by default.
        calibration: The calibration of that machine.
        photographs: The photographs of the front's scene; None if unknown: then those of the
            stage's scene count.
    """

    seconds: float
    stage: luigi.Task
    calibration: Calibration
    photographs: Photographs | None


class CostModel:
    """Predicts the costs of stages on one machine.

    Reads each family's earlier builds once.
    """

    def __init__(
        self,
        here: Calibration,
        sizes: Sizes,
        reference: ReferenceCosts,
        *,
        uses_own_builds: bool = True,
    ) -> None:
        self.here, self.reference = here, reference
        self._sizes = {**sizes, reference.scene: reference.photographs}
        self._known_drivers: dict[tuple[luigi.Task, bool], Mapping[str, float]] = {}
        self._samples = functools.cache(_samples_here if uses_own_builds else _no_samples)

    def expected(self, stage: luigi.Task, measured: MeasuredSeconds | None = None) -> ExpectedCost:
        """Returns the expected cost of a stage.

        Args:
            stage: The stage to be built.
            measured: The seconds of such a stage on a front; where nothing was built here, they
                replace the reference's seconds if the two stages are comparable.
        """
        cost = self._by_own_builds(stage)
        if cost is None:
            cost = self._by_reference(stage)
            if measured and (seconds := self._seconds_of_front(stage, measured)) is not None:
                cpu_seconds = cost.cpu_seconds * seconds / cost.seconds
                cost = replace(cost, seconds=seconds, cpu_seconds=cpu_seconds, evidence="the front")
        return replace(cost, peak_memory_bytes=self._memory(stage) or cost.peak_memory_bytes)

    def _by_own_builds(self, stage: luigi.Task) -> ExpectedCost | None:
        if not isinstance(stage, StoredTask):
            return None
        found = []
        for sample in most_similar(self._samples(stage.task_family), significant(stage)):
            earlier = _task_of(stage.task_family, sample.parameters)
            if earlier is not None and self._is_comparable(stage, earlier):
                scale = self._scale(stage, earlier)
                found.append(self._scaled(sample.cost, *scale, "this machine"))
        if not found:
            return None
        middle = sorted(found, key=lambda cost: cost.seconds)[len(found) // 2]
        return replace(middle, seconds=median(cost.seconds for cost in found))

    def _by_reference(self, stage: luigi.Task) -> ExpectedCost:
        cost = self.reference.stages.get(work_of(stage), Cost(START_S, 0, START_S, 0))
        slower = self.here.times_slower_than(self.reference.calibration, stage.task_family)
        work, written = self._scale(stage, self.reference.stage_like(stage))
        expected = self._scaled(cost, work, written, "the reference")
        added = added_seconds(work_of(stage), self._drivers(stage))
        cpu_seconds = expected.cpu_seconds + self.reference.calibration.machine.cores * added
        return replace(
            expected, seconds=slower * (expected.seconds + added), cpu_seconds=slower * cpu_seconds
        )

    def _seconds_of_front(self, stage: luigi.Task, measured: MeasuredSeconds) -> float | None:
        """Returns the seconds here, scaled from the front's stage; None if they do not compare."""
        work, here, sizes = work_of(stage), self._drivers(stage), self._sizes
        if measured.photographs:
            sizes = {str(stage.param_kwargs.get("scene", "")): measured.photographs}
        there = drivers_of(measured.stage, sizes, settings={})
        if work != work_of(measured.stage) or not is_comparable(work, here, there):
            return None
        slower = self.here.times_slower_than(measured.calibration, stage.task_family)
        return slower * seconds_scaled(measured.seconds, START_S, work_ratio(work, here, there))

    def _is_comparable(self, stage: luigi.Task, earlier: luigi.Task) -> bool:
        drivers = self._drivers(stage), self._drivers(earlier, settings={})
        work = work_of(stage)
        return work == work_of(earlier) and is_comparable(work, *drivers)

    def _scale(self, stage: luigi.Task, earlier: luigi.Task) -> tuple[float, float]:
        """Returns the ratio of the work, and that of the written bytes."""
        here, there = self._drivers(stage), self._drivers(earlier, settings={})
        work, bytes_ratio = work_of(stage), 1.0
        for name in WRITTEN.get(work, ()):
            if here.get(name) and there.get(name):
                bytes_ratio *= here[name] / there[name]
        return work_ratio(work, here, there), bytes_ratio

    def _scaled(self, cost: Cost, work: float, written: float, evidence: Evidence) -> ExpectedCost:
        seconds = seconds_scaled(cost.seconds, START_S, work)
        busy = self.here.machine.cores * cost.seconds  # where it is not known, all cores are
        cpu_seconds = busy if cost.cpu_seconds is None else min(busy, cost.cpu_seconds)
        ratio = seconds / cost.seconds if cost.seconds else 1.0
        size = round(written * (cost.output_bytes or 0))
        return ExpectedCost(seconds, ratio * cpu_seconds, cost.peak_memory_bytes, size, evidence)

    def _drivers(self, stage: luigi.Task, **upstream: Any) -> Mapping[str, float]:
        name = stage, bool(upstream)
        if name not in self._known_drivers:
            self._known_drivers[name] = drivers_of(stage, self._sizes, **upstream)
        return self._known_drivers[name]

    def _memory(self, stage: luigi.Task) -> int | None:
        """Returns the predicted memory, where the stage and the photographs are known."""
        if not isinstance(stage, ConfigurableStage) or demand_name(stage) not in GROWTH:
            return None
        photographs = self._sizes.get(str(stage.param_kwargs["scene"]))
        if photographs is None:
            return None
        return round(sum(predicted_bytes(demand_of(stage), photographs).values()))


WRITTEN: dict[str, tuple[str, ...]] = {
    "SceneCapture": ("photographs",),
    "CameraPoses": ("photographs",),
    "RadianceField": ("field.appearance_ranks",),
    "StylizedField": ("field.appearance_ranks",),
    "TrajectoryFrames": ("frames", "frame_pixels"),
    "PriorRenders": ("frame_pixels",),
    "StylizedPriors": ("frame_pixels",),
    "StylizedFrames": ("frames", "frame_pixels", "bytes_a_pixel"),
}
"""The drivers to which the bytes of an artifact are proportional, by work."""


def _samples_here(family: str) -> list[CostSample]:
    """Returns the builds of this machine; those without a host are from before hosts were noted."""
    ours = ("", socket.gethostname())
    return [sample for sample in cost_history(current_store(), family) if sample.host in ours]


def _no_samples(_family: str) -> list[CostSample]:
    return []


def _task_of(family: str, parameters: Mapping[str, str]) -> luigi.Task | None:
    """Returns the task of a line; None if there are no such tasks or parameters any more."""
    try:
        kind = Register.get_task_cls(family)  # type: ignore[no-untyped-call]
        return kind.from_str_params(dict(parameters))  # type: ignore[no-any-return]
    except Exception:  # noqa: BLE001  lines of any earlier version
        return None
