"""Cost and quality of a variant, from the records of its stages."""

import json
import math
import os
import socket
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from statistics import fmean
from typing import Any, TypeVar

from pipeline.maintenance.ancestors import ancestors
from pipeline.record import ActionRecord
from styletrf.evaluation.trade_off import Measurement, Part
from tasks.machine.calibration import processor
from tasks.presets.sweep import Variant

Amount = TypeVar("Amount", int, float)

SCENE = {
    "SceneCapture", "CameraPoses", "SceneModel", "RadianceField", "QualityMetrics",
    "TrajectoryFrames",
}  # fmt: skip
"""Stages of the scene side; all others are on the style side."""

REUSABLE_STAGES = {"RadianceField", "StylizedField", "StyleNetwork"}
"""Stages whose artifacts are reused, to render or to stylize other scenes."""

_LONG_SECONDS = 5.0
_LEAST_RATIO = 1e-6  # the painting itself

METRIC_STAGES = {"StylizationMetrics"}
"""Stages of metrics that the main command does not build."""


def measurement(
    variant: Variant, lineage: Iterable[ActionRecord], summary: Mapping[str, Any]
) -> Measurement:
    """Returns the cost and the quality of a variant on its side.

    Args:
        variant: The variant that was measured.
        lineage: The records of all its stages, also of the other side.
        summary: The numbers of QualityMetrics for the scene; those of StylizationMetrics,
            StyleMetrics and ConsistencyMetrics together for the style.
    """
    own = [r for r in lineage if _part(r) == variant.part and r.action.family not in METRIC_STAGES]
    return Measurement(
        part=variant.part,
        name=variant.name,
        tuning=variant.tuning,
        quality_db=quality_db(variant.part, summary),
        loss_db=None if variant.part == "scene" else loss_db(summary),
        resemblance_db=None if variant.part == "scene" else resemblance_db(summary),
        consistency_ratio=consistency_ratio(summary),
        stylizer=variant.stylizer,
        seconds=_by_family(own, lambda record: _number(record, "seconds")),
        other_cpu_share=_largest_other_fraction(own),
        peak_memory_bytes=int(max((_number(r, "peak_memory_bytes") for r in own), default=0)),
        model_bytes=_by_family(
            (r for r in own if r.action.family in REUSABLE_STAGES),
            lambda record: record.output.size,
        ),
    )


def lineage_of(artifact: Path, records: Iterable[ActionRecord]) -> dict[str, ActionRecord]:
    """Returns the records of an artifact and of everything upstream, by digest.

    Args:
        artifact: Its folder in the store, named by its digest.
        records: The records to search.
    """
    by_digest = {record.output.digest: record for record in records}
    return {record.output.digest: record for record in ancestors([artifact.name], by_digest)}


def quality_db(part: Part, summary: Mapping[str, Any]) -> float:
    """Returns the PSNR, or the mean of `loss_db` and `resemblance_db`."""
    if part == "scene":
        return float(summary["psnr"])
    return (loss_db(summary) + resemblance_db(summary)) / 2


def loss_db(summary: Mapping[str, Any]) -> float:
    """Returns -10 log10 of the style and content loss, the objective of style networks."""
    return -10 * math.log10(summary["style_and_content"])


def resemblance_db(summary: Mapping[str, Any]) -> float:
    """Returns -10 log10 of the mean ratio of patches, texture and Gram matrices.

    No training uses these. Unstylized frames have 0 dB; more is nearer to the painting. A missing
    ratio (the scene is the painting) counts as 1.
    """
    names = ("style_swd_patches", "style_swd_texture", "style_gram")
    ratios = [summary[f"{name}_ratio"] for name in names]
    mean = fmean(1.0 if ratio is None else ratio for ratio in ratios)
    return -10 * math.log10(max(mean, _LEAST_RATIO))


def consistency_ratio(summary: Mapping[str, Any]) -> float | None:
    """Returns the error of frames one apart, warped along the depth, over its floor.

    None without ConsistencyMetrics, and if no two such frames show the same.
    """
    nearest = summary.get("delta_1", {})
    error, floor = nearest.get("normalized_error"), nearest.get("normalized_floor")
    return None if error is None or not floor else float(error) / float(floor)


def summary_in(folder: Path) -> dict[str, Any]:
    """Returns the `summary.json` of an artifact."""
    return dict(json.loads((folder / "summary.json").read_text()))


def machine(records: Iterable[ActionRecord]) -> str:
    """Returns a description of this machine, with the hosts of the records if they differ."""
    hosts = {str(r.provenance.get("host", "")) for r in records if _number(r, "seconds")}
    elsewhere = (
        f"; measured on {', '.join(sorted(hosts))}" if hosts - {socket.gethostname()} else ""
    )
    return f"{os.cpu_count()} cores, {processor()}{elsewhere}"


def measured_on(records: Iterable[ActionRecord]) -> str:
    """Returns the day of the latest record."""
    return max(str(record.provenance.get("started", ""))[:10] for record in records)


def _by_family(
    records: Iterable[ActionRecord], measure: Callable[[ActionRecord], Amount]
) -> dict[str, Amount]:
    """Returns the sum over each stage's records; a stage with `--shards` has several."""
    total: dict[str, Amount] = {}
    for record in records:
        family = record.action.family
        total[family] = measure(record) + total.get(family, 0)
    return total


def _part(record: ActionRecord) -> Part:
    return "scene" if record.action.family in SCENE else "style"


def _number(record: ActionRecord, name: str) -> float:
    value: Any = record.provenance.get(name, 0)
    return float(value)


def _largest_other_fraction(records: Iterable[ActionRecord]) -> float | None:
    """Returns the largest fraction of CPU time that other processes took during long stages.

    None if it is unknown for one of them.
    """
    long = [record for record in records if _number(record, "seconds") >= _LONG_SECONDS]
    if not all("other_cpu_seconds" in record.provenance for record in long):
        return None
    cores = os.cpu_count() or 1
    fractions = (
        _number(r, "other_cpu_seconds") / (cores * _seconds_of_last_attempt(r)) for r in long
    )
    return max(fractions, default=0.0)


def _seconds_of_last_attempt(record: ActionRecord) -> float:
    return max(_number(record, "seconds") - _number(record, "earlier_seconds"), 1.0)
