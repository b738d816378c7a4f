"""Ways to map photographs, tried one after the other for as long as too little is explained."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from styletrf.sfm.mapping import SfmResult, is_explained

_LOGGER = logging.getLogger(__name__)
# A share placed with which a capture does: below it a warning is due, and time well spent.
ENOUGH_PLACED = 0.8


@dataclass(frozen=True, slots=True)
class Rung:
    """One way to map.

    Attributes:
        name: In words, for the reason.
        attempt: Maps, knowing the best mapping so far; None where it has nothing to try.
        unless_placed: It is not worth its time where so large a share of the photographs is placed
            and their matches are explained.
    """

    name: str
    attempt: Callable[[SfmResult | None], SfmResult | None]
    unless_placed: float = 1.0


def best_mapping(rungs: Sequence[Rung], photographs: int) -> SfmResult:
    """Returns the best mapping of the rungs up to the first that explains enough.

    Its `mapper_reason` is one line: what each rung that was tried placed and explained. Where that
    is too little after a rung, it is a warning at once, since the next ones may take minutes.

    Raises:
        ValueError: No rung has anything to try.
    """
    best: SfmResult | None = None
    lines: list[str] = []
    for rung in rungs:
        if best is not None and _is_enough(best, rung.unless_placed * photographs):
            continue
        mapping = rung.attempt(best)
        if mapping is None:
            continue
        lines.append(
            f"{rung.name} placed {mapping.registered} of {photographs}"
            f" and explains {mapping.explained:.0%} of their matches"
        )
        best = mapping if best is None else max(best, mapping, key=lambda m: m.quality)
        is_enough = _is_enough(best, ENOUGH_PLACED * photographs)
        _LOGGER.log(logging.INFO if is_enough else logging.WARNING, lines[-1])
    if best is None:
        raise ValueError("no rung has anything to try")
    return replace(best, mapper_reason=", ".join(lines)) if len(lines) > 1 else best


def _is_enough(mapping: SfmResult, placed: float) -> bool:
    return mapping.registered >= placed and is_explained(mapping)
