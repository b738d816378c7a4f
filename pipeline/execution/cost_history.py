"""The costs of earlier builds, from which plans predict later ones; no result depends on them.

`costs/FAMILY.jsonl` in the store has one line for each build. A build is expected to cost as much
as the earlier builds that share the most parameters with it.
"""

import contextlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

from pipeline.store import Store

_READ_BYTES = 1 << 18  # of the newest lines
_NEWEST = 5
_RESERVE = 1.2  # factor on the memory of earlier builds
DEFAULT_SECONDS = 60.0
"""The expected time of a build without any earlier builds."""


@dataclass(frozen=True, slots=True)
class Cost:
    """The cost of a build; `cpu_seconds` and `output_bytes` are None if they were not recorded."""

    seconds: float
    peak_memory_bytes: int
    cpu_seconds: float | None = None
    output_bytes: int | None = None


@dataclass(frozen=True, slots=True)
class CostSample:
    """The cost of a finished build, with its serialized parameters and its host."""

    parameters: Mapping[str, str]
    cost: Cost
    host: str = ""


def record_cost(store: Store, family: str, sample: CostSample) -> None:
    """Adds a line, unless the disk is full or the store cannot be written to."""
    line = json.dumps(asdict(sample), sort_keys=True).encode() + b"\n"
    with contextlib.suppress(OSError), _file(store, family).open("ab", buffering=0) as file:
        file.write(line)  # at once, since other processes add lines, too


def cost_history(store: Store, family: str) -> list[CostSample]:
    """Returns the costs of the newest builds of a family, the oldest first.

    It skips lines that cannot be read: the first may be cut off, and any by a full disk.
    """
    found: list[CostSample] = []
    file = _file(store, family)
    with contextlib.suppress(OSError), file.open("rb") as lines:
        lines.seek(max(0, file.stat().st_size - _READ_BYTES))
        for line in lines:
            with contextlib.suppress(ValueError, TypeError, KeyError, AttributeError):
                noted: dict[str, Any] = json.loads(line)
                host = str(noted.get("host", ""))
                found.append(CostSample(dict(noted["parameters"]), Cost(**noted["cost"]), host))
    return found


def cost_of_similar(earlier: list[CostSample], parameters: Mapping[str, str]) -> Cost | None:
    """Returns the expected cost of a build with these parameters; None without earlier builds.

    The five newest builds that share the most parameters decide it. The time is their median. The
    memory is a fifth more than their largest.
    """
    costs = [sample.cost for sample in most_similar(earlier, parameters)]
    if not costs:
        return None
    memory = _RESERVE * max(c.peak_memory_bytes for c in costs)
    return Cost(median(c.seconds for c in costs), int(memory))


def most_similar(earlier: Sequence[CostSample], parameters: Mapping[str, str]) -> list[CostSample]:
    """Returns the newest builds, at most five, of those that share most of the parameters."""
    shared = [len(sample.parameters.items() & parameters.items()) for sample in earlier]
    most = max(shared, default=0)
    return [s for s, n in zip(earlier, shared, strict=True) if n == most][-_NEWEST:]


def _file(store: Store, family: str) -> Path:
    return store.root / "costs" / f"{family}.jsonl"
