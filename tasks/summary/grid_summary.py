"""The summary of a grid: the outcome of every cell, what the stages cost, and failure reasons."""

import json
import logging
import os
import socket
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, get_args

from pipeline.maintenance.task_graph import upstream_first
from pipeline.record import ActionRecord
from pipeline.settings import current_store, out_root
from pipeline.shared_store.sync import upload_key_list
from styletrf.files.atomic_write import atomic_write
from tasks.command.found_records import found_record
from tasks.command.outcomes import Outcome, outcome_of_missing
from tasks.command.sources import begin_of_command
from tasks.summary.gallery import refresh_gallery
from tasks.summary.webhook import post_to_webhook

_log = logging.getLogger("pipeline")
EXIT_STATUS: dict[Outcome, int] = {"failed": 31, "late": 26}
"""Exit status of a command that made some cells: others failed, or were skipped for `--until`."""


@dataclass(frozen=True, slots=True)
class CellOutcome:
    """The outcome of a scene in a style; `reason` says why its result is missing."""

    scene: str
    style: str
    outcome: Outcome
    reason: str = ""


@dataclass(frozen=True, slots=True)
class CostSummary:
    """The cost of a stage or of a scene in this run: artifacts built and found, and resources."""

    name: str
    built: int
    found: int
    seconds: float
    gpu_seconds: float
    peak_memory_bytes: int
    bytes: int


@dataclass(frozen=True, slots=True)
class GridSummary:
    """One run of a grid; times are ISO 8601 in UTC, `keys` are those of all existing artifacts."""

    begun: str
    ended: str
    host: str
    cells: Sequence[CellOutcome]
    keys: Sequence[str]
    stages: Sequence[CostSummary]
    scenes: Sequence[CostSummary]

    def count(self, outcome: Outcome) -> int:
        """Returns the number of cells with this outcome."""
        return sum(cell.outcome == outcome for cell in self.cells)

    @property
    def exit_status(self) -> int | None:
        """Returns 0 if every cell exists, 31 or 26 if some do; None leaves it to Luigi."""
        n_there = self.count("made") + self.count("found")
        if n_there == len(self.cells):
            return 0
        statuses = (status for outcome, status in EXIT_STATUS.items() if self.count(outcome))
        return next(statuses, None) if n_there else None


def finish_command(root: Any) -> int | None:
    """Publishes the summary of a grid and writes the gallery, at the end of its command.

    Returns:
        The exit status; None if Luigi's is right.
    """
    begun = begin_of_command()
    summary = summarize(root.cells(), begun)
    publish_summary(summary)
    if summary.keys:
        name = f"{begun:%Y%m%dT%H%M%SZ}-{summary.host}-{os.getpid()}"
        upload_key_list(current_store(), name, summary.keys)
    if path := refresh_gallery(None):  # which reads the summary
        print(path)  # noqa: T201  the command's answer
    return summary.exit_status


def summarize(cells: Iterable[Any], begun: datetime) -> GridSummary:
    """Returns the summary of the requested cells.

    Args:
        cells: One `StylizedTrajectory` per cell.
        begun: When the command began. Earlier artifacts are found; earlier failures do not count.
    """
    cells = [each for requested in cells for each in requested.cells()]
    made: dict[str, ActionRecord] = {}
    scenes_of: dict[str, set[str]] = {}
    for task in upstream_first(*cells):
        if record := found_record(task):  # several tasks may share an artifact
            made[record.action.key] = record
            scenes_of.setdefault(record.action.key, set()).add(getattr(task, "scene", ""))
    families: dict[str, list[ActionRecord]] = {}
    scenes: dict[str, list[ActionRecord]] = {}
    for key, record in made.items():
        families.setdefault(record.action.family, []).append(record)
        scene, *others = scenes_of[key]
        scenes.setdefault("all scenes" if others or not scene else scene, []).append(record)
    return GridSummary(
        begun=begun.isoformat(timespec="seconds"),
        ended=datetime.now(UTC).isoformat(timespec="seconds"),
        host=socket.gethostname(),
        cells=[_outcome(cell, begun) for cell in cells],
        keys=sorted(made),
        stages=[_cost_summary(name, of, begun) for name, of in families.items()],
        scenes=[_cost_summary(name, of, begun) for name, of in scenes.items()],
    )


def publish_summary(summary: GridSummary) -> None:
    """Writes `out/grid.json`, prints a few lines, and posts it to the webhook if there is one."""
    path = out_root() / "grid.json"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as partial:
            partial.write_text(json.dumps(asdict(summary), indent=1, sort_keys=True) + "\n")
        _link_former_name(path)
    except OSError as error:
        _log.warning("%s could not be written: %s", path, error)
    for line in format_lines(summary):
        _log.info("%s", line)
    fields = {name: value for name, value in asdict(summary).items() if name != "keys"}
    post_to_webhook({"text": "\n".join(format_lines(summary)), **fields})


def _link_former_name(path: Path) -> None:
    """Makes `out/night.json`, its name in earlier versions, a link to the summary."""
    former = path.with_name("night.json")
    if former.is_file() or former.is_symlink():
        former.unlink()
    former.symlink_to(path.name)


def format_lines(summary: GridSummary) -> list[str]:
    """Returns the summary in a few lines."""
    counts = [f"{summary.count(o)} {o}" for o in get_args(Outcome) if summary.count(o)]
    stages = summary.stages
    built, found = sum(stage.built for stage in stages), sum(stage.found for stage in stages)
    hours = sum(stage.seconds for stage in stages) / 3600
    gpu_hours = sum(stage.gpu_seconds for stage in stages) / 3600
    size = sum(stage.bytes for stage in stages)
    lines = [
        f"{len(summary.cells)} cells: {', '.join(counts)}",
        f"{built} stages built in {hours:.2f} h, {gpu_hours:.2f} h of them on GPUs;"
        f" {found} found done; the store grew by {size / 2**20:.0f} MiB",
    ]
    reasons: dict[str, list[str]] = {}
    for cell in summary.cells:
        if cell.outcome in ("failed", "under way"):
            reasons.setdefault(cell.reason, []).append(f"{cell.scene} {cell.style}")
    return lines + [f"{', '.join(names)}: {reason}" for reason, names in reasons.items()]


def _outcome(cell: Any, begun: datetime) -> CellOutcome:
    name = cell.scene, cell.style
    if record := found_record(cell):
        if not cell.complete():  # the log says why
            return CellOutcome(*name, "failed", "it is made, but cannot be linked in out/")
        return CellOutcome(*name, "made" if _began(record) >= begun else "found")
    missing = outcome_of_missing(cell, since=begun)
    return CellOutcome(*name, missing.outcome, missing.explanation)


def _cost_summary(name: str, records: Sequence[ActionRecord], begun: datetime) -> CostSummary:
    built = [record for record in records if _began(record) >= begun]
    costs: list[Mapping[str, Any]] = [record.provenance for record in built]
    return CostSummary(
        name=name,
        built=len(built),
        found=len(records) - len(built),
        seconds=sum(float(p["seconds"]) for p in costs),
        gpu_seconds=sum(float(p["seconds"]) * _gpus(p) for p in costs),
        peak_memory_bytes=max((int(p["peak_memory_bytes"]) for p in costs), default=0),
        bytes=sum({r.output.digest: r.output.size for r in built}.values()),
    )


def _gpus(provenance: Mapping[str, Any]) -> int:
    return len([gpu for gpu in str(provenance.get("gpu", "")).split(",") if gpu])


def _began(record: ActionRecord) -> datetime:
    return datetime.fromisoformat(str(record.provenance["started"]))
