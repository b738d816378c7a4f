"""What the report of a stylised fly-through says, gathered from the store."""

import json
import platform
import shlex
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.task import StoredTask
from styletrf.curve_chart import Curve
from styletrf.report import Metric, ReportContent, StageCost
from styletrf.tables import read_rows, read_summary

if TYPE_CHECKING:
    from tasks.trajectory import StylizedTrajectory


def summary_of(inputs: Mapping[str, Path]) -> dict[str, Any]:
    """Returns the metrics of one result."""
    return {
        "quality": read_summary(inputs["quality"] / "summary.json"),
        "consistency": read_summary(inputs["consistency"] / "summary.json"),
    }


def report_content(task: "StylizedTrajectory", inputs: Mapping[str, Path]) -> ReportContent:
    """Returns the content of `report.html`; files are named as `out/SCENE/STYLE/` links them."""
    stages = list(_upstream(task))
    return ReportContent(
        scene=task.scene,
        style=task.style,
        quality=task.quality,
        video="video.mp4",
        unstylized_video="unstylized.mp4",
        poster="poster.png",
        style_image="style.png",
        priors=[f"priors/{path.name}" for path in sorted((inputs["priors"] / "frames").iterdir())],
        curves=_curves(inputs),
        metrics=_metrics(summary_of(inputs)),
        stages=[_cost(stage) for stage in stages],
        parameters={stage.task_family: dict(stage.identity_parameters()) for stage in stages},
        versions={
            "python": platform.python_version(),
            **{name: version(name) for name in ("styletrf", "torch", "pycolmap", "luigi", "numba")},
        },
        digests={stage.task_family: _record(stage).output.digest for stage in stages},
        command=_command(task, stages),
    )


def _command(task: "StylizedTrajectory", stages: list[StoredTask]) -> str:
    """Returns the command that makes this result again."""
    words = ["luigi", "--module", "tasks", "StylizedTrajectory"]
    for name, value in task.identity_parameters().items():
        words += [f"--{name}", str(value)]
    for stage in stages:
        settings = stage.param_kwargs.get("settings")
        if settings:
            words += [f"--{stage.task_family}-settings", json.dumps(dict(settings))]
    return shlex.join(words)


def _upstream(task: StoredTask) -> Iterator[StoredTask]:
    """Yields every stage above a task once, first things first."""
    seen: dict[str, StoredTask] = {}

    def visit(stage: StoredTask) -> None:
        for upstream in stage.requires().values():
            if upstream.task_id not in seen:
                visit(upstream)
                seen[upstream.task_id] = upstream

    visit(task)
    return iter(seen.values())


def _record(stage: StoredTask) -> Any:
    return stage.record()


def _cost(stage: StoredTask) -> StageCost:
    provenance = _record(stage).provenance
    return StageCost(
        stage.task_family, float(provenance["seconds"]), int(provenance["peak_memory_bytes"])
    )


def _curves(inputs: Mapping[str, Path]) -> list[Curve]:
    field = read_rows(inputs["field"] / "curve.parquet")
    network = read_rows(inputs["network"] / "curve.parquet")
    adaptation = read_rows(inputs["adaptation"] / "curve.parquet")
    return [
        _curve("Radiance field", "PSNR of training rays, dB", field, "psnr"),
        _curve("Style network", "perceptual loss", network, "loss"),
        _curve("Adaptation to the style", "PSNR against the priors, dB", adaptation, "psnr"),
    ]


def _curve(title: str, quantity: str, rows: list[dict[str, Any]], column: str) -> Curve:
    return Curve(
        title, quantity, [float(row["seconds"]) for row in rows], [float(r[column]) for r in rows]
    )


def _metrics(summary: Mapping[str, Any]) -> list[Metric]:
    quality, consistency = summary["quality"], summary["consistency"]
    short, long = consistency["delta_1"], consistency["delta_5"]
    return [
        Metric("PSNR", f"{quality['psnr']:.2f} dB", "the field against photographs held out"),
        Metric("SSIM", f"{quality['ssim']:.3f}", "structure kept; 1 is the photograph itself"),
        _consistency("short-term error", short, "change between neighbouring frames"),
        _consistency("long-term error", long, "change between frames five apart"),
    ]


def _consistency(name: str, values: Mapping[str, Any], meaning: str) -> Metric:
    error, floor = (values.get(key) for key in ("error", "floor"))
    told = ["not measured" if value is None else f"{value:.5f}" for value in (error, floor)]
    return Metric(name, told[0], f"{meaning}, along the flow of the unstylised frames", told[1])
