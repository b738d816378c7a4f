"""Attempts to map photographs, one after the other for as long as too little is explained."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from styletrf.sfm.mapping import SfmResult, is_explained

_LOGGER = logging.getLogger(__name__)
# Placing this fraction of the photographs is enough; below it a warning and more time are due.
ENOUGH_PLACED = 0.8


@dataclass(frozen=True, slots=True)
class MappingAttempt:
    """One way to map photographs.

    Attributes:
        name: The name in words, for the reason.
        attempt: Maps, given the best mapping so far; returns None where it has nothing to try.
        skip_if_placed: Skips this attempt if at least this fraction of the photographs already has
            a camera and the matches are explained; infinite where the attempt decides itself.
        least_gain: Replaces the best mapping only if it explains so many times as much: its placed
            photographs times the fraction of the matches that it explains.
    """

    name: str
    attempt: Callable[[SfmResult | None], SfmResult | None]
    skip_if_placed: float = 1.0
    least_gain: float = 0.0


def best_mapping(attempts: Sequence[MappingAttempt], photographs: int) -> SfmResult:
    """Returns the best mapping of the attempts up to the first that explains enough.

    Its `mapper_reason` is one line: what each attempt placed and explained. Where that is too
    little after an attempt, it is a warning at once, since the next ones may take minutes.

    Raises:
        ValueError: No attempt has anything to try.
    """
    best: SfmResult | None = None
    lines: list[str] = []
    for attempt in attempts:
        if best is not None and _is_enough(best, attempt.skip_if_placed * photographs):
            continue
        mapping = attempt.attempt(best)
        if mapping is None:
            continue
        lines.append(
            f"{attempt.name} placed {mapping.registered} of {photographs}"
            f" and explains {mapping.explained:.0%} of their matches"
        )
        if best is None or _is_better(mapping, best, attempt.least_gain):
            best = mapping
        is_enough = _is_enough(best, ENOUGH_PLACED * photographs)
        _LOGGER.log(logging.INFO if is_enough else logging.WARNING, lines[-1])
    if best is None:
        raise ValueError("no attempt has anything to try")
    return replace(best, mapper_reason=", ".join(lines)) if len(lines) > 1 else best


def _is_enough(mapping: SfmResult, placed: float) -> bool:
    return mapping.registered >= placed and is_explained(mapping)


def _is_better(mapping: SfmResult, best: SfmResult, least_gain: float) -> bool:
    gained = mapping.registered * mapping.explained
    return mapping.quality > best.quality and (
        gained >= least_gain * best.registered * best.explained
    )
