"""What the tasks of the graph have in common."""

from collections.abc import Generator, Iterable, Mapping
from typing import Any, ClassVar, TypeVar

import luigi
from luigi.cmdline_parser import CmdlineParser

from pipeline.parameters import ChoiceParameter, DictParameter, IntParameter
from pipeline.task import StoredTask
from styletrf.errors import InputError, NetworkError
from tasks.qualities import QUALITIES, settings_for
from tasks.sources import SOURCE_PRIORITY, is_source, require_sources

Needed = TypeVar("Needed", bound="Stage")


class Stage(StoredTask):
    """A stage of the graph; a user's mistake is an `InputError`.

    Attributes:
        computes: Whether its `build` computes on `device`.
    """

    user_errors = (InputError,)
    transient_errors = (ConnectionError, TimeoutError, NetworkError)
    computes: ClassVar[bool] = False

    device = ChoiceParameter(
        choices=["auto", "cpu", "cuda"],
        default="auto",
        significant=False,
        description="where to compute: a GPU where there is one (auto), cpu or cuda",
    )

    shards = IntParameter(
        default=1,
        significant=False,
        description="in how many parts frames and priors are made, at once where workers are free",
    )

    @property
    def label(self) -> str:
        """The stage on the screen: its family and its words, but for those that are usual."""
        names = self.get_param_names()  # type: ignore[no-untyped-call]
        told = [self.param_kwargs[name] for name in names if not self.is_usual(name)]
        return " ".join([self.task_family, *(v for v in told if isinstance(v, str) and v)])

    @property
    def needs_gpu(self) -> bool:
        """Whether it computes, and may do so on a GPU."""
        return self.computes and self.device != "cpu"

    @property
    def priority(self) -> int:  # type: ignore[override]
        """Sources first; then by the seconds from a stage's begin to the command's end."""
        command = CmdlineParser.get_instance()  # type: ignore[no-untyped-call]
        if command is None:
            return 0
        from tasks.build_order import seconds_to_the_end

        seconds = round(seconds_to_the_end(command.get_task_obj()).get(self.task_id, 0.0))
        return seconds + SOURCE_PRIORITY * is_source(self)

    def require_sound(self) -> None:
        """Refuses parameters that do not go together, before anything long begins.

        Raises:
            InputError: They do not.
        """
        if self.shards < 1:
            raise InputError(f"--shards {self.shards}", "makes nothing", "Give 1 or more")

    def run(self) -> "Generator[StoredTask, None, None] | None":
        """Makes the artifact, unless a source of the command failed."""
        command = CmdlineParser.get_instance()  # type: ignore[no-untyped-call]
        require_sources(self, command.get_task_obj() if command else None)
        return super().run()

    def need(self, stage: type[Needed], **others: Any) -> Needed:
        """Returns an upstream stage with this one's scene, style, quality and so on."""
        names = set(stage.get_param_names(include_significant=True))  # type: ignore[no-untyped-call]
        names -= {"settings", "timeout_seconds", "memory_gib", "shard"}
        shared = {name: self.param_kwargs[name] for name in names if name in self.param_kwargs}
        return stage(**{**shared, **others})


class GradedStage(Stage):
    """A stage that depends on the quality, if only by what is upstream of it."""

    quality = ChoiceParameter(
        choices=list(QUALITIES),
        default="standard",
        description="draft for a look in minutes, standard, or the paper's own settings",
    )
    tuning: Any = DictParameter(
        default={},
        description="settings of stages that replace the quality's, such as"
        ' {"RadianceField": {"iterations": 500}}',
    )

    def identity_parameters(self) -> Mapping[str, object]:
        """Nothing but the inputs."""
        return {}


class TunedStage(GradedStage):
    """A stage whose configuration comes from the quality's column of `tasks/qualities.py`.

    Its key covers the values, not the quality's name: two qualities that agree share the artifact.
    """

    settings: Any = DictParameter(
        default={}, description='values that replace the quality\'s, such as {"iterations": 500}'
    )

    def values(self) -> dict[str, Any]:
        """Returns the stage's settings: the quality's, then the family's own, then those tuned."""
        tuned = _thawed(self.tuning).get(self.task_family, {})
        return {**settings_for(self.task_family, self.quality), **_thawed(self.settings), **tuned}

    def identity_parameters(self) -> Mapping[str, object]:
        """The values of the settings."""
        return {"settings": self.values()}


def stages_with_settings(stages: Iterable[luigi.Task]) -> list[str]:
    """Returns the stages that have settings of their own, which win over the quality's."""
    return sorted({s.task_family for s in stages if isinstance(s, TunedStage) and s.settings})


def _thawed(value: Any) -> Any:
    """Returns Luigi's frozen dictionaries and tuples as plain ones."""
    if isinstance(value, Mapping):
        return {key: _thawed(item) for key, item in value.items()}
    return [_thawed(item) for item in value] if isinstance(value, tuple) else value
