"""Shards: frames built in parts by several builds at once, each an ordinary artifact.

Frames joined from shards are byte-identical to those of a single build.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import luigi

from styletrf.errors import InputError
from tasks.stages.stage import ConfigurableStage, Stage

Item = TypeVar("Item")


class ShardedStage(ConfigurableStage):
    """A stage whose frames are independent, so that shards can be built in parallel."""

    shard = luigi.Parameter(
        default="", positional=False, description="a part of the frames only, such as 2/5"
    )

    def validate(self) -> None:
        """Rejects an invalid shard.

        Raises:
            InputError: It is not such as 2/5.
        """
        super().validate()
        self.own_shard([])

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns the settings, and the shard if it is one."""
        return {**super().identity_parameters(), **self.shard_identity()}

    def shard_identity(self) -> Mapping[str, object]:
        """Returns the shard; nothing for the whole, which is the same with shards and without."""
        return {"shard": self.shard} if self.shard else {}

    def shard_stages(self) -> Mapping[str, Stage]:
        """Returns the stages that build one shard each, if `--shards` is larger than 1."""
        if self.shard or self.shards <= 1:
            return {}
        return {
            f"shard {k:04d}": self.clone(shard=f"{k}/{self.shards}")  # type: ignore[no-untyped-call]
            for k in range(1, self.shards + 1)
        }

    def sharding(self, inputs: Mapping[str, Path]) -> Any:
        """Returns the `styletrf.steps.sharding.Sharding` of a build with these inputs."""
        from styletrf.steps.sharding import Sharding

        return Sharding(self.own_shard, bool(self.shard), shard_folders(inputs))

    def own_shard(self, items: Sequence[Item]) -> Sequence[Item]:
        """Returns the items of this shard: neighbors, as many as in the others, or one fewer."""
        return shard_of(items, f"--shard {self.shard}") if self.shard else items


def shard_of(items: Sequence[Item], argument: str) -> Sequence[Item]:
    """Returns neighbors in a sequence; the sizes of its shards differ by one at most.

    Args:
        items: All of them.
        argument: The argument that names the shard, such as `--part 2/5`.

    Raises:
        InputError: It names none.
    """
    number, slash, count = argument.split()[-1].partition("/")
    if slash and number.isdigit() and count.isdigit() and 1 <= int(number) <= int(count):
        k, n = int(number), int(count)
        return items[(k - 1) * len(items) // n : k * len(items) // n]
    raise InputError(argument, "is not a valid part", "Give one such as 2/5")


def shard_folders(inputs: Mapping[str, Path]) -> list[Path]:
    """Returns the folders of the shards among a build's inputs, in order."""
    return [inputs[name] for name in sorted(inputs) if name.startswith("shard ")]
