"""The base classes of the stages."""

import functools
from collections.abc import Generator, Iterable, Mapping
from typing import Any, ClassVar, TypeVar

import luigi
from luigi.cmdline_parser import CmdlineParser
from luigi.freezing import recursively_freeze, recursively_unfreeze
from luigi.parameter import ParameterException

from pipeline.job import Display
from pipeline.parameters import BoolParameter, ChoiceParameter, DictParameter, IntParameter
from pipeline.task import RunContext, StoredTask
from styletrf.errors import InputError, NetworkError
from styletrf.steps.step_run import StepRun
from tasks.command.build_order import seconds_to_the_end
from tasks.command.sources import SOURCE_PRIORITY, require_sources, source_rank
from tasks.machine.thread_adjustment import ThreadAdjustment
from tasks.presets.former_names import require_one_name, with_present_names
from tasks.presets.presets import PRESETS, settings_for

Upstream = TypeVar("Upstream", bound="Stage")


class Stage(StoredTask):
    """A stage of the graph; invalid input raises an `InputError`.

    Attributes:
        uses_device: Whether its `build` computes on `device`.
    """

    user_errors = (InputError,)
    transient_errors = (ConnectionError, TimeoutError, NetworkError)
    uses_device: ClassVar[bool] = False

    device = ChoiceParameter(
        choices=["auto", "cpu", "cuda"],
        default="auto",
        significant=False,
        description="where to compute: a GPU where there is one (auto), cpu or cuda",
    )

    shards = IntParameter(
        default=1,
        significant=False,
        description="number of shards of frames and priors, which are made at once if there are"
        " free workers",
    )

    keep_going = BoolParameter(
        significant=False,
        description="builds all that needs no painting, photographs, content or weights that are"
        " missing or cannot be used, instead of stopping, and despite a predicted lack of memory or"
        " disk space",
    )

    @classmethod
    @functools.cache
    def get_params(cls) -> list[tuple[str, luigi.Parameter]]:
        """Returns the parameters, for which Luigi looks among all attributes at every call."""
        return super().get_params()  # type: ignore[no-untyped-call, no-any-return]

    @property
    def label(self) -> str:
        """Returns the stage's name on the console: its family and its given parameters."""
        names = self.get_param_names()  # type: ignore[no-untyped-call]
        given = [self.param_kwargs[name] for name in names if not self.is_default(name)]
        return " ".join([self.task_family, *(v for v in given if isinstance(v, str) and v)])

    @property
    def needs_gpu(self) -> bool:
        """Returns whether the build computes on a GPU if there is one."""
        return self.uses_device and self.device != "cpu"

    @property
    def priority(self) -> int:  # type: ignore[override]
        """Sources come first by rank; then stages with the most seconds left to the end."""
        command = CmdlineParser.get_instance()  # type: ignore[no-untyped-call]
        if command is None:
            return 0
        seconds = round(seconds_to_the_end(command.get_task_obj()).get(self.task_id, 0.0))
        return seconds + SOURCE_PRIORITY * source_rank(self)

    def validate(self) -> None:
        """Rejects invalid combinations of parameters, before anything long begins.

        Raises:
            InputError: A combination is invalid.
        """
        if self.shards < 1:
            raise InputError(f"--shards {self.shards}", "is below 1", "Give 1 or more")

    def run(self) -> "Generator[StoredTask, None, None] | None":
        """Builds the artifact, unless a source of the command failed before it."""
        command = CmdlineParser.get_instance()  # type: ignore[no-untyped-call]
        require_sources(self, command.get_task_obj() if command else None)
        return super().run()

    def display_of_build(self, display: Display) -> Display:
        """Returns a display whose reports adjust the threads of the build to the free cores."""
        return ThreadAdjustment(display)

    def step_run(self, run: RunContext) -> StepRun:
        """Returns the part of a run that the step of this stage uses."""
        return StepRun(run.resume, self.device, run.progress, run.log)

    def upstream(self, stage: type[Upstream], **others: Any) -> Upstream:
        """Returns an upstream stage with this one's scene, style, quality and other parameters."""
        names = _shared_names(stage)
        shared = {name: self.param_kwargs[name] for name in names if name in self.param_kwargs}
        return stage(**{**shared, **others})


@functools.cache
def _shared_names(stage: type[Stage]) -> frozenset[str]:
    """Returns the parameters that a stage takes over; Luigi sorts all of them at every call."""
    names = stage.get_param_names(include_significant=True)  # type: ignore[no-untyped-call]
    return frozenset(names) - {"settings", "timeout_seconds", "memory_gib", "shard"}


class TuningParameter(DictParameter):
    """Settings by stage."""

    allowed = """settings by stage, such as '{"RadianceField": {"iterations": 500}}'"""

    def parse(self, x: str) -> Any:
        """Returns the settings.

        Raises:
            ParameterException: The text is not a JSON object of objects.
        """
        tuning = super().parse(x)
        if not all(isinstance(settings, Mapping) for settings in tuning.values()):
            raise ParameterException(f"{self.flag} {x}: this is not {self.allowed}")
        return tuning


class PresetStage(Stage):
    """A stage that depends on the preset (`--quality`), itself or through its inputs."""

    quality = ChoiceParameter(
        choices=list(PRESETS),
        default="standard",
        description="draft for a look in minutes, standard, or the paper's own settings",
    )
    tuning: Any = TuningParameter(
        default={},
        description="settings of stages that replace the quality's, such as"
        ' {"RadianceField": {"iterations": 500}}',
    )

    @classmethod
    def get_param_values(cls, params: Any, args: Any, kwargs: Any) -> list[tuple[str, Any]]:
        """Returns the parameters as Luigi does, with settings by their present names."""
        found = dict(super().get_param_values(params, args, kwargs))  # type: ignore[no-untyped-call]
        if tuning := found["tuning"]:
            tuning = {stage: with_present_names(stage, given) for stage, given in tuning.items()}
            found["tuning"] = recursively_freeze(tuning)  # type: ignore[no-untyped-call]
        if own := found.get("settings"):
            own = with_present_names(cls.get_task_family(), own)  # type: ignore[no-untyped-call]
            found["settings"] = recursively_freeze(own)  # type: ignore[no-untyped-call]
        return list(found.items())

    def validate(self) -> None:
        """Rejects a setting that is given by its former and its present name.

        Raises:
            InputError: It is, or another combination of parameters is invalid.
        """
        super().validate()
        for stage, settings in self.tuning.items():
            require_one_name(stage, settings)
        require_one_name(self.task_family, getattr(self, "settings", {}))

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns no parameters: the inputs decide the artifact."""
        return {}

    def tuned(
        self, family: str, quality: str, settings: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """Returns the settings of a stage: the preset's, then its own, then those of `--tuning`."""
        tuning = recursively_unfreeze(self.tuning)  # type: ignore[no-untyped-call]
        own = recursively_unfreeze(settings or {})  # type: ignore[no-untyped-call]
        return {**settings_for(family, quality), **own, **tuning.get(family, {})}


class ConfigurableStage(PresetStage):
    """A stage whose configuration comes from the preset's column of `tasks/presets/presets.py`.

    Its key covers the values, not the preset's name: presets with equal values share an artifact.
    """

    settings: Any = DictParameter(
        default={}, description='values that replace the quality\'s, such as {"iterations": 500}'
    )

    def values(self) -> dict[str, Any]:
        """Returns the settings: the preset's, then `--STAGE-settings`, then those of `--tuning`."""
        return self.tuned(self.task_family, self.quality, self.settings)

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns the settings."""
        return {"settings": self.values()}


def stages_with_settings(stages: Iterable[luigi.Task]) -> list[str]:
    """Returns the families with `--STAGE-settings`, which replace the preset's."""
    configurable = (stage for stage in stages if isinstance(stage, ConfigurableStage))
    return sorted({stage.task_family for stage in configurable if stage.settings})
