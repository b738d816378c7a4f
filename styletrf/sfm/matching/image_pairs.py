"""Pairs of photographs in which to look for matches."""

import re
from collections import Counter
from collections.abc import Sequence
from itertools import combinations, pairwise

from styletrf.capture.capture_file import Photograph

Pairs = list[tuple[int, int]]
Sequences = list[list[int]]
"""Positions of photographs that were taken one after another."""


def shots(photographs: Sequence[Photograph]) -> Sequences:
    """Returns the frames of each shot of a video, in time; other photographs are in none.

    Of panoramas each direction has a sequence of its own.
    """
    found: dict[tuple[str, int, str | None], list[tuple[float, int]]] = {}
    for index, one in enumerate(photographs):
        if one.clip is not None and one.time_s is not None:
            sequence = one.clip, one.shot, one.direction
            found.setdefault(sequence, []).append((one.time_s, index))
    return [[index for _, index in sorted(frames)] for frames in found.values()]


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

    Each photograph is paired with its `overlap` successors and with those 2, 4, 8 ... further on:
    about count (overlap + log2 count) pairs in all. These pairs do not show where the path comes
    back to a place.
    """
    near = {*range(1, overlap + 1), *(2**k for k in range(count.bit_length()))}
    return sorted((i, i + step) for step in near for i in range(count - step))


def pairs_along(sequences: Sequences, overlap: int) -> Pairs:
    """Returns the `sequence_pairs` of several sequences, each i < j."""
    found = {
        (min(one[i], one[j]), max(one[i], one[j]))
        for one in sequences
        for i, j in sequence_pairs(len(one), overlap)
    }
    return sorted(found)


def pairs_within(sequences: Sequences, steps: int) -> Pairs:
    """Returns the pairs i < j of photographs at most so many steps apart in one sequence."""
    found = {
        (min(i, j), max(i, j))
        for one in sequences
        for k, i in enumerate(one)
        for j in one[k + 1 : k + 1 + steps]
    }
    return sorted(found)


def pieces(count: int, links: Pairs) -> list[int]:
    """Returns for each photograph the first one that links connect it with, or itself."""
    earlier = list(range(count))

    def first(k: int) -> int:
        while earlier[k] != k:
            earlier[k] = earlier[earlier[k]]
            k = earlier[k]
        return k

    for i, j in links:
        one, other = sorted((first(i), first(j)))
        earlier[other] = one
    return [first(k) for k in range(count)]


def pairs_of(pairs: Pairs, members: Sequence[int]) -> Pairs:
    """Returns those of the pairs of which at least one is among `members`."""
    chosen = set(members)
    return [(i, j) for i, j in pairs if i in chosen or j in chosen]


def pairs_with(count: int, members: Sequence[int]) -> Pairs:
    """Returns the pairs i < j of which at least one is among `members`."""
    return pairs_of(all_pairs(count), members)
