"""Shards: a part of the frames of a step, rendered by itself, and joined later."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from styletrf.errors import InputError

Item = TypeVar("Item")


def shard_of(items: Sequence[Item], shard: str, argument: str = "--shard") -> Sequence[Item]:
    """Returns a shard of a sequence: neighbors. The sizes of shards differ by one at most.

    Args:
        items: All items.
        shard: Such as `2/5`; empty for all.
        argument: The argument of a command that names the shard.

    Raises:
        InputError: The shard is not of the form 2/5.
    """
    if not shard:
        return items
    number, slash, count = shard.partition("/")
    if slash and number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count):
        k, n = int(number), int(count)
        return items[(k - 1) * len(items) // n : k * len(items) // n]
    raise InputError(f"{argument} {shard}", "is not K/N with K from 1 to N", "Give one such as 2/5")


def shard_folders(inputs: Mapping[str, Path]) -> list[Path]:
    """Returns the folders of finished shards among the inputs of a step, in order."""
    return [inputs[name] for name in sorted(inputs) if name.startswith("shard ")]
