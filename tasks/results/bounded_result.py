"""A result whose settings a bound on its time or its quality may choose.

`--budget 5min` and `--quality "within 0.5 dB"` choose them from a measured front. The front depends
on the kind of space, which is known once the scene model is made: until then the result requires
that model and the sources. `run` then yields the result with the chosen settings to Luigi.
"""

import logging
from abc import abstractmethod
from collections.abc import Generator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Self, cast

import luigi

from pipeline.errors import StoreError
from pipeline.maintenance.task_graph import upstream_first
from pipeline.settings import current_store, out_root
from pipeline.task import StoredTask
from styletrf.errors import InputError
from styletrf.evaluation.trade_off import Combination, Tuning
from tasks.command.root_task import is_typed
from tasks.command.sources import is_source
from tasks.planning.kept_choice import choice_for, keep_choice, known_choice
from tasks.planning.remaining_time import timing_of
from tasks.presets.presets import PRESETS
from tasks.presets.quality_choice import (
    Choice,
    Front,
    fronts_for,
    known_space,
    require_reachable,
    slowest_choice,
)
from tasks.presets.quality_request import QualityParameter, QualityRequest, quality_request
from tasks.stages.linked_results import LinkedStage
from tasks.stages.scene import SceneModel
from tasks.stages.stage import Stage, stages_with_settings
from tasks.stages.style_parameters import FrameParameters

_log = logging.getLogger("pipeline")


class BoundedResult(LinkedStage, FrameParameters):
    """A fly-through at a preset, or with the settings that a bound on time or quality chooses."""

    quality = QualityParameter(
        choices=list(PRESETS),
        default="standard",
        description='draft, standard or paper; or "within 0.5 dB": the fastest settings whose'
        " quality is at most so far below the best, by a measured front",
    )
    budget = luigi.Parameter(
        default="",
        description="such as 5min: the best settings that take no longer on this machine: those"
        " of standard if there is time for them, or else of a measured front",
    )

    @property
    def request(self) -> QualityRequest | None:
        """Returns the bound on time or quality, unless a preset is named."""
        return quality_request(self.quality, self.budget)

    def validate(self) -> None:
        """Rejects an ambiguous bound on time or quality, and one combined with settings.

        Raises:
            InputError: The parameters contradict each other.
        """
        super().validate()
        names_quality = is_typed("quality") or not self.is_default("quality")
        if self.budget and names_quality and self.quality in PRESETS:
            subject = f"--quality {self.quality} --budget {self.budget}"
            raise InputError(subject, "ask for settings twice", "Leave one of them out")
        if self.request and self.tuning:
            problem = "does not go with a bound on time or quality, which chooses the settings"
            raise InputError(f"--tuning {dict(self.tuning)}", problem, "Leave one of them out")
        if self.request and (changed := stages_with_settings(upstream_first(self._plain()))):
            problem = "do not go with a bound on time or quality, which chooses them"
            raise InputError(f"settings of {', '.join(changed)}", problem, "Leave one of them out")

    def require_reachable(self) -> None:
        """Rejects a bound on time or quality that no settings meet, before the first stage.

        Until the kind of space is known, the points of all candidate fronts count. Artifacts in
        the store take no time.

        Raises:
            InputError: Of a budget, it names the nearest that can be reached.
        """
        if self.request and not self.resolved():
            require_reachable(self.request, self._fronts(), timing_of(self))

    def requires(self) -> Mapping[str, Stage]:
        """Returns the stages of the result; with a bound, the scene model and the sources."""
        if not self.request:
            return self.stages()
        sources = [task for task in upstream_first(self._plain()) if is_source(task)]
        named = {task.task_id: cast("Stage", task) for task in sources}
        return {"model": self.upstream(SceneModel, quality=PRESETS[0]), **named}

    @abstractmethod
    def stages(self) -> dict[str, Stage]:
        """Returns the stages whose artifacts the result shows, at its preset and settings."""

    def cells(self) -> list[Self]:
        """Returns the requested result, with its settings if they are chosen."""
        return [self.resolved() or self]

    def expected_result(self) -> Self:
        """Returns the result whose stages are validated: a draft until the settings are chosen."""
        return (self.resolved() or self._plain()) if self.request else self

    def _plain(self) -> Self:
        """Returns the same result at the first preset, for its sources, which all presets share."""
        return self.with_settings(PRESETS[0], {})

    def with_settings(self, quality: str, tuning: Tuning, **others: str) -> Self:
        """Returns the same fly-through at a preset, with settings of stages and other options."""
        changed = {"quality": quality, "tuning": tuning, "budget": "", **others}
        return type(self)(**{**self.param_kwargs, **changed})

    def at_point(self, front: Front, point: Combination) -> Self:
        """Returns the same fly-through with the settings and the stylizer of a point of a front."""
        others = {"stylizer": point.stylizer} if point.stylizer else {}
        return self.with_settings(front.quality_of(point), point.tuning, **others)

    def complete(self) -> bool:
        """Returns whether the result, with a bound the chosen one, is in the store and `out/`."""
        resolved = self.resolved()
        return resolved.complete() if resolved else super().complete()

    def run(self) -> "Generator[StoredTask, None, None] | None":
        """Builds the result; with a bound, yields the task with the chosen settings to Luigi."""
        return self._run_resolved() if self.request else super().run()

    def _run_resolved(self) -> "Generator[StoredTask, None, None]":
        try:
            choice = self._keep_choice()
        except (InputError, StoreError) as error:
            raise self._failure(error, current_store()) from error
        yield self.at_point(choice.front, choice.point)

    def resolved(self) -> Self | None:
        """Returns the result with the settings chosen for a bound on time or quality.

        None without a bound, before `choose_settings` or `run` choose, if no settings meet the
        bound, and if the store does not give the scene model, which `run` reports.
        """
        try:
            if not self.request:
                return None
            self.validate()
            if not self._space():
                return None
            choice = known_choice(self, self.request, self._fronts()[0])
        except (InputError, StoreError, OSError):
            return None
        return self.at_point(choice.front, choice.point) if choice else None

    def choose_settings(self) -> None:
        """With a bound, chooses the settings if the kind of space is known, and keeps them.

        It may measure the speed of the machine. If no settings meet the bound, or the store does
        not give the scene model, it chooses none.
        """
        with suppress(InputError, StoreError, OSError):
            if self.request:
                self.validate()
                if self._space():
                    self._keep_choice()

    def planned(self) -> tuple[Self, str, Choice | None]:
        """Returns the task that `--plan` describes, and with a bound how and what was chosen.

        While the kind of space is unknown, the slowest choice of all candidate fronts counts.

        Raises:
            InputError: No settings meet the bound.
        """
        if not self.request:
            return self, "", None
        if self._space():
            choice, known = self._choice(), ""
        else:
            choice = slowest_choice(self.request, self._fronts(), timing_of(self))
            known = "the kind of space is unknown yet; the slowest case: "
        return self.at_point(choice.front, choice.point), f"{known}{choice.description}", choice

    def _keep_choice(self) -> Choice:
        """Returns the settings for a bound, and keeps them for the next command.

        Raises:
            InputError: No settings meet the bound.
        """
        choice = self._choice()
        keep_choice(self, self._fronts()[0], choice)
        _log.info("%s: %s", self.label, choice.description)
        return choice

    def _choice(self) -> Choice:
        return choice_for(self, cast("QualityRequest", self.request), self._fronts()[0])

    def _fronts(self) -> Sequence[Front]:
        """Returns the scene's own front, or those of its kind of space; all while it is unknown."""
        measured = Path(out_root(), self.scene, "trade-off", "front.json")
        fronts = fronts_for(measured, self._space())
        return [f.without_stylizers() for f in fronts] if self.decides_stylizer else fronts

    def _space(self) -> str | None:
        return known_space(self.requires()["model"])
