"""Frames made in parts, by several builds at once: each part is an ordinary artifact.

What is put together from parts is the same, byte by byte, as what one build makes.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import luigi

from styletrf.errors import InputError
from tasks.stage import Stage, TunedStage

Item = TypeVar("Item")


class ShardedStage(TunedStage):
    """A stage whose frames do not depend on each other."""

    shard = luigi.Parameter(
        default="", positional=False, description="a part of the frames alone, such as 2/5"
    )

    def require_sound(self) -> None:
        """Refuses parts that are none.

        Raises:
            InputError: With what to give instead.
        """
        super().require_sound()
        self.of_part([])

    def identity_parameters(self) -> Mapping[str, object]:
        """The values of the settings, and of a part which it is."""
        return {**super().identity_parameters(), **self.identity_of_part()}

    def identity_of_part(self) -> Mapping[str, object]:
        """What tells a part from the whole, which is the same with parts and without."""
        return {"shard": self.shard} if self.shard else {}

    def parts(self) -> Mapping[str, Stage]:
        """The stages that make a part each, where `--shards` asks for several."""
        if self.shard or self.shards <= 1:
            return {}
        return {
            f"shard {k:04d}": self.clone(shard=f"{k}/{self.shards}")  # type: ignore[no-untyped-call]
            for k in range(1, self.shards + 1)
        }

    def of_part(self, items: Sequence[Item]) -> Sequence[Item]:
        """Returns those of a part: neighbours, as many as of the others, or one fewer."""
        return part_of(items, f"--shard {self.shard}") if self.shard else items


def part_of(items: Sequence[Item], told: str) -> Sequence[Item]:
    """Returns neighbours of a sequence, the same number for each part but for one.

    Args:
        items: All of them.
        told: The words that ask for a part, such as `--part 2/5`.

    Raises:
        InputError: They name none.
    """
    number, slash, count = told.split()[-1].partition("/")
    if slash and number.isdigit() and count.isdigit() and 1 <= int(number) <= int(count):
        k, n = int(number), int(count)
        return items[(k - 1) * len(items) // n : k * len(items) // n]
    raise InputError(told, "is no part", "Give one such as 2/5")


def parts_in(inputs: Mapping[str, Path]) -> list[Path]:
    """Returns the folders of the parts among a build's inputs, in order."""
    return [inputs[name] for name in sorted(inputs) if name.startswith("shard ")]
