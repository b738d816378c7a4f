"""What became of a grid: its cells, what they cost, and why some are missing."""

import errno
import json
import logging
import os
import socket
import urllib.request
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from http.client import HTTPException
from ssl import SSLError
from typing import Any, Literal
from urllib.error import HTTPError, URLError

import luigi

from pipeline.maintenance.attempts import find_blocking_failure
from pipeline.record import ActionRecord
from pipeline.settings import current_store, out_root, setting
from pipeline.shared_store.sync import list_night
from pipeline.task import StoredTask
from tasks.graph import graph
from tasks.sources import begin_of_command
from tasks.wall import refresh_wall

screen = logging.getLogger("pipeline")
Outcome = Literal["made", "found", "failed", "under way", "late", "not begun"]
EXIT_STATUS: dict[Outcome, int] = {"failed": 31, "late": 26}
"""Of a command that made a part of its grid: some of the rest failed; it was not begun in time."""


@dataclass(frozen=True, slots=True)
class CellOutcome:
    """What became of a scene in a style; `reason` where it is not there."""

    scene: str
    style: str
    outcome: Outcome
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Spending:
    """What a stage, or a scene, took this time, and what of it was found done."""

    name: str
    built: int
    found: int
    seconds: float
    gpu_seconds: float
    peak_memory_bytes: int
    bytes: int


@dataclass(frozen=True, slots=True)
class Night:
    """One run of a grid, from `begun` to `ended` (ISO 8601, UTC); `keys` of all that is there."""

    begun: str
    ended: str
    host: str
    cells: Sequence[CellOutcome]
    keys: Sequence[str]
    stages: Sequence[Spending]
    scenes: Sequence[Spending]

    def count(self, outcome: Outcome) -> int:
        """How many cells came out so."""
        return sum(cell.outcome == outcome for cell in self.cells)

    @property
    def exit_status(self) -> int | None:
        """0 if all is there, whoever made it; what tells that a part is; else Luigi knows more."""
        n_there = self.count("made") + self.count("found")
        if n_there == len(self.cells):
            return 0
        told = (status for outcome, status in EXIT_STATUS.items() if self.count(outcome))
        return next(told, None) if n_there else None


def conclude(root: Any) -> int | None:
    """Ends the command of a grid: says what became of it, and writes the index.

    Returns:
        The exit status; None if Luigi's is right.
    """
    begun = begin_of_command()
    night = look_back(root.cells(), begun)
    tell(night)
    if night.keys:
        name = f"{begun:%Y%m%dT%H%M%SZ}-{night.host}"
        list_night(current_store(), name, night.keys)
    if path := refresh_wall(root):
        print(path)  # noqa: T201  the command's answer
    return night.exit_status


def look_back(cells: Iterable[Any], begun: datetime) -> Night:
    """Returns what became of the cells since `begun`.

    Args:
        cells: The results asked for.
        begun: When the command began.
    """
    cells = [granted for cell in cells for granted in cell.cells()]
    stages = {task.task_id: task for cell in cells for task in graph(cell)}
    records = {name: _record(task) for name, task in stages.items()}
    made = {name: record for name, record in records.items() if record}
    families: dict[str, list[ActionRecord]] = {}
    scenes: dict[str, list[ActionRecord]] = {}
    for name, record in made.items():
        families.setdefault(record.action.family, []).append(record)
        scenes.setdefault(getattr(stages[name], "scene", "") or "all scenes", []).append(record)
    return Night(
        begun=begun.isoformat(timespec="seconds"),
        ended=datetime.now(UTC).isoformat(timespec="seconds"),
        host=socket.gethostname(),
        cells=[_outcome(cell, begun) for cell in cells],
        keys=sorted({record.action.key for record in made.values()}),
        stages=[_spending(name, of, begun) for name, of in families.items()],
        scenes=[_spending(name, of, begun) for name, of in scenes.items()],
    )


def tell(night: Night) -> None:
    """Writes `out/night.json`, shows it in short, and posts it where the user wants to read it."""
    path = out_root() / "night.json"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_suffix(".partial")
        partial.write_text(json.dumps(asdict(night), indent=1, sort_keys=True) + "\n")
        partial.replace(path)
    except OSError as error:
        screen.warning("%s could not be written: %s", path, error)
    for line in in_words(night):
        screen.info("%s", line)
    if address := setting("night", "webhook"):
        _post(address, night)


def in_words(night: Night) -> list[str]:
    """Returns the night in a few lines."""
    counts = [f"{night.count(o)} {o}" for o in _OUTCOMES if night.count(o)]
    built = sum(stage.built for stage in night.stages)
    found = sum(stage.found for stage in night.stages)
    seconds = sum(stage.seconds for stage in night.stages)
    gpu = sum(stage.gpu_seconds for stage in night.stages)
    size = sum(stage.bytes for stage in night.stages)
    lines = [
        f"{len(night.cells)} cells: {', '.join(counts)}",
        f"{built} stages built in {seconds / 3600:.2f} h, {gpu / 3600:.2f} h of them on GPUs;"
        f" {found} found done; the store grew by {size / 2**20:.0f} MiB",
    ]
    reasons: dict[str, list[str]] = {}
    for cell in night.cells:
        if cell.outcome in ("failed", "under way"):
            reasons.setdefault(cell.reason, []).append(f"{cell.scene} {cell.style}")
    return lines + [f"{', '.join(names)}: {reason}" for reason, names in reasons.items()]


_OUTCOMES: tuple[Outcome, ...] = ("made", "found", "failed", "under way", "late", "not begun")


def _outcome(cell: Any, begun: datetime) -> CellOutcome:
    name = cell.scene, cell.style
    if record := _record(cell):
        return CellOutcome(*name, "made" if _began(record) >= begun else "found")
    problem = find_blocking_failure(cell, current_store(), since=begun)
    if problem is None:
        return CellOutcome(*name, "not begun", "this machine has tried nothing")
    ended: Outcome = "late" if problem.kind == "late" else "failed"
    outcome: Outcome = "under way" if problem.is_under_way else ended
    return CellOutcome(*name, outcome, f"{problem.task.task_family}: {problem.reason}")


def _spending(name: str, records: Sequence[ActionRecord], begun: datetime) -> Spending:
    built = [record for record in records if _began(record) >= begun]
    told: list[Mapping[str, Any]] = [record.provenance for record in built]
    return Spending(
        name=name,
        built=len(built),
        found=len(records) - len(built),
        seconds=sum(float(p["seconds"]) for p in told),
        gpu_seconds=sum(float(p["seconds"]) * _cards(p) for p in told),
        peak_memory_bytes=max((int(p["peak_memory_bytes"]) for p in told), default=0),
        bytes=sum({r.output.digest: r.output.size for r in built}.values()),
    )


def _cards(provenance: Mapping[str, Any]) -> int:
    return len([card for card in str(provenance.get("gpu", "")).split(",") if card])


def _record(task: luigi.Task) -> ActionRecord | None:
    try:
        return task.record() if isinstance(task, StoredTask) else None
    except Exception:  # noqa: BLE001  what it is the obstacle tells
        return None


def _began(record: ActionRecord) -> datetime:
    return datetime.fromisoformat(str(record.provenance["started"]))


def _post(address: str, night: Night) -> None:
    """Sends the night as JSON; that nobody answers is told, and costs nothing else.

    The address is a secret: who has it can post. It is told nowhere, and neither is the text of an
    error, which may quote it.
    """
    told = {name: value for name, value in asdict(night).items() if name != "keys"}
    body = json.dumps({"text": "\n".join(in_words(night)), **told}).encode()
    kind = {"Content-Type": "application/json"}
    try:
        asked = urllib.request.Request(address, body, kind)  # noqa: S310  the user's own address
        with urllib.request.urlopen(asked, timeout=20):  # noqa: S310
            pass
    except (OSError, ValueError, HTTPException) as error:
        problem = f"nothing was posted to [night] webhook: {_without_address(error)}"
        screen.warning("%s. Check the address in luigi.cfg.", problem)


def _without_address(error: Exception) -> str:
    """Returns what went wrong by status, number or sort: no text that came from elsewhere."""
    match error:
        case HTTPError(code=code):
            return f"the server answered {code}"
        case URLError(reason=Exception() as reason):
            return _without_address(reason)
        case SSLError():
            return f"no secure connection ({type(error).__name__})"
        case OSError(errno=int(number)) if number in errno.errorcode:
            return os.strerror(number)
        case ValueError() | URLError():
            return "it is no web address"
    return f"the server did not answer as one does ({type(error).__name__})"
