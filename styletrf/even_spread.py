"""Chooses some elements of a sequence, spread evenly from the first to the last."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

Thing = TypeVar("Thing")


def evenly_spread(things: Sequence[Thing], count: int) -> list[Thing]:
    """Returns `count` elements, or all where there are fewer, in their order and each once."""
    if not things:
        return []
    places = np.linspace(0, len(things) - 1, min(count, len(things))).round().astype(int)
    return [things[place] for place in places]
