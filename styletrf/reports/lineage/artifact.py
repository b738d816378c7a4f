"""An artifact of a scene, as its lineage shows it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

State: TypeAlias = Literal["made", "removed", "under way", "failed", "not made"]


@dataclass(frozen=True, slots=True)
class Artifact:
    """An artifact, made or only requested.

    Attributes:
        name: Its key, or another name of its own.
        family: The stage that makes it.
        label: The stage with its parameters.
        state: The state of the artifact; "removed" ones were made, and are in the store no longer.
        inputs: The names of those that it was made from, or waits for.
        painting: The style that it is of; "" if several paintings share it.
        made: The time when its build began, as ISO 8601; "" if it was not made.
        seconds: The duration of its build.
        size_bytes: Its size on disk.
        host: The machine that built it.
        reason: The reason why it failed.
        page: Its page, relative to the lineage's; "" if it has none.
    """

    name: str
    family: str
    label: str
    state: State
    inputs: Sequence[str] = ()
    painting: str = ""
    made: str = ""
    seconds: float | int | None = None
    size_bytes: int | None = None
    host: str = ""
    reason: str = ""
    page: str = ""


def in_topological_order(artifacts: Iterable[Artifact]) -> list[Artifact]:
    """Returns the artifacts so that each follows its inputs; ties are by family and name.

    Inputs that are not among them are passed over.
    """
    given = {each.name: each for each in artifacts}
    ordered: dict[str, Artifact] = {}
    pending = sorted(given.values(), key=lambda each: (each.family, each.name), reverse=True)
    while pending:
        each = pending[-1]
        before = [given[name] for name in each.inputs if name in given and name not in ordered]
        if each.name in ordered or not before:
            ordered.setdefault(each.name, pending.pop())
        else:
            pending += before
    return list(ordered.values())


def names_of_ancestors(ordered: Sequence[Artifact]) -> Mapping[str, frozenset[str]]:
    """Returns, by artifact, the names of all that it was made from.

    Args:
        ordered: The artifacts; each follows its inputs.
    """
    found: dict[str, frozenset[str]] = {}
    for each in ordered:
        inputs = frozenset(name for name in each.inputs if name in found)
        found[each.name] = inputs.union(*(found[name] for name in inputs))
    return found
