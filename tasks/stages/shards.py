"""Shards: frames that several builds make at once, each shard an ordinary artifact.

Frames joined from shards are byte-identical to those of a single build.
"""

from collections.abc import Mapping
from dataclasses import replace

import luigi

from pipeline.task import RunContext
from styletrf.steps.sharding import shard_of
from styletrf.steps.step_run import StepRun
from tasks.stages.stage import ConfigurableStage, Stage


class ShardedStage(ConfigurableStage):
    """A stage whose frames are independent, so that shards can be built in parallel."""

    shard = luigi.Parameter(
        default="", positional=False, description="builds one shard of the frames, such as 2/5"
    )

    def validate(self) -> None:
        """Rejects an invalid shard.

        Raises:
            InputError: The shard is not of the form 2/5.
        """
        super().validate()
        shard_of([], self.shard)

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns the settings, and the shard if it is one."""
        return {**super().identity_parameters(), **self.shard_identity()}

    def shard_identity(self) -> Mapping[str, object]:
        """Returns the shard; nothing for the whole, which is the same with shards and without."""
        return {"shard": self.shard} if self.shard else {}

    def step_run(self, run: RunContext) -> StepRun:
        """Returns the part of a run that the step uses, with the shard."""
        return replace(super().step_run(run), shard=self.shard)

    def shard_stages(self) -> Mapping[str, Stage]:
        """Returns the stages that build one shard each, if `--shards` is larger than 1."""
        if self.shard or self.shards <= 1:
            return {}
        return {
            f"shard {k:04d}": self.clone(shard=f"{k}/{self.shards}")  # type: ignore[no-untyped-call]
            for k in range(1, self.shards + 1)
        }
