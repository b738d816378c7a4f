"""Which pairs of photographs to look for matches in."""

import re
from collections import Counter
from collections.abc import Sequence
from itertools import combinations, pairwise

Pairs = list[tuple[int, int]]


def is_sequence(names: Sequence[str]) -> bool:
    """Returns whether naturally ordered names read like frames: one pattern, an even counter.

    The last number of the name counts, and at least half of its steps are equal: frames of a
    video, a camera's consecutive files; not dates, not identifiers of collected images.
    """
    patterns = {re.sub("[0-9]+", "#", name) for name in names}
    if len(names) < 2 or len(patterns) > 1 or "#" not in patterns.pop():
        return False
    counters = [int(re.findall("[0-9]+", name)[-1]) for name in names]
    steps = Counter(b - a for a, b in pairwise(counters))
    step, times = steps.most_common(1)[0]
    return step > 0 and 2 * times >= len(names) - 1


def all_pairs(count: int) -> Pairs:
    """Returns the count (count - 1) / 2 pairs of indices i < j."""
    return list(combinations(range(count), 2))


def sequence_pairs(count: int, overlap: int) -> Pairs:
    """Returns pairs of indices i < j for photographs taken one after another.

    Each with its `overlap` successors and with those 2, 4, 8 ... further on; and, since a path
    may come back to a place, every `overlap`-th with every other `overlap`-th. About
    count (overlap + log2 count) + (count / overlap)^2 / 2 in all.
    """
    near = {*range(1, overlap + 1), *(2**k for k in range(count.bit_length()))}
    pairs = {(i, i + step) for step in near for i in range(count - step)}
    return sorted(pairs | set(combinations(range(0, count, overlap), 2)))


def pairs_with(count: int, members: Sequence[int]) -> Pairs:
    """Returns the pairs i < j of which at least one is among `members`."""
    chosen = set(members)
    return [(i, j) for i, j in all_pairs(count) if i in chosen or j in chosen]
