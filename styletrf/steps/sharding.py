"""Shards: a part of the frames of a step, rendered by itself, and joined later."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from styletrf.geometry.cameras import Camera

Select = Callable[[Sequence[Camera]], Sequence[Camera]]


@dataclass(frozen=True, slots=True)
class Sharding:
    """The shard to render, or the shards to join.

    Attributes:
        select: Returns the items of the shard from all of them; all for the whole.
        is_shard: Whether only a shard is rendered.
        folders: Of finished shards, which are joined instead of rendering.
    """

    select: Select
    is_shard: bool
    folders: Sequence[Path] = ()
