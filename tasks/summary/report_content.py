"""The content of the report of a stylized fly-through, gathered from the store."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from luigi.task_register import Register

from pipeline.record import ActionRecord
from styletrf.files.tables import read_rows, read_summary
from styletrf.reports.coverage_text import registration_summary, support_summary
from styletrf.reports.curve_chart import Curve
from styletrf.reports.report import ReportContent, StageCost
from tasks.command.main_command import main_command
from tasks.presets.presets import settings_for
from tasks.summary.metric_labels import metric_tables, term


def summary_of(
    parameters: Mapping[str, Any], inputs: Mapping[str, Path], lineage: Sequence[ActionRecord]
) -> dict[str, Any]:
    """Returns the numbers of one result: its metrics, its cost, and its parameters."""
    costs = [_cost(record) for record in lineage]
    return {
        "quality": read_summary(inputs["quality"] / "summary.json"),
        "consistency": read_summary(inputs["consistency"] / "summary.json"),
        "resemblance": read_summary(inputs["resemblance"] / "summary.json"),
        "path": read_summary(inputs["trajectory"] / "support.json"),
        "cost": {
            "seconds": sum(cost.seconds for cost in costs),
            "peak_memory_bytes": max((cost.peak_memory_bytes or 0 for cost in costs), default=0),
        },
        "parameters": dict(parameters),
        "words": dict(parameters),  # their name in earlier versions
    }


def report_content(
    parameters: Mapping[str, Any],
    inputs: Mapping[str, Path],
    poster: Path,
    lineage: Sequence[ActionRecord],
) -> ReportContent:
    """Returns the content of `report.html`.

    Args:
        parameters: The parameters of the command.
        inputs: The artifacts shown.
        poster: The frame shown while nothing plays.
        lineage: The records of everything upstream.
    """
    tuning = tuning_of(parameters, lineage)
    return ReportContent(
        scene=parameters["scene"],
        style=parameters["style"],
        quality=parameters["quality"],
        summary=" ".join(
            [
                registration_summary(inputs["poses"], inputs["capture"], inputs["quality"]),
                support_summary(read_summary(inputs["trajectory"] / "support.json")),
            ]
        ),
        video=inputs["frames"] / "video.mp4",
        unstylized_video=inputs["trajectory"] / "video.mp4",
        poster=poster,
        style_image=inputs["style"] / "style.png",
        priors=_priors(inputs),
        curves=_curves(inputs, lineage),
        metrics=metric_tables(summary_of(parameters, inputs, lineage)),
        error_curves=_error_curves(read_rows(inputs["consistency"] / "pairs.parquet")),
        stages=[_cost(record) for record in lineage],
        parameters={name: _parameters(record) for name, record in _named(lineage).items()},
        versions={
            **{name: version(name) for name in ("styletrf", "luigi")},
            **{name: number for record in lineage for name, number in record.action.tools.items()},
        },
        digests={name: record.output.digest for name, record in _named(lineage).items()},
        command=main_command(parameters, tuning),
        viewer_command=viewer_command(parameters, tuning),
    )


def viewer_command(parameters: Mapping[str, Any], tuning: Mapping[str, Mapping[str, Any]]) -> str:
    """Returns the command of a viewer that shows the same stylized field; "" where none can.

    Fields of the strategies s1 and s2 have a geometry of their own, painted frames have no field,
    and networks from elsewhere are no parameter of a viewer.
    """
    method, strategy = parameters.get("method", "field"), parameters.get("strategy", "s3")
    if (method, strategy, parameters.get("network", "")) != ("field", "s3", ""):
        return ""
    of_field = {name: value for name, value in parameters.items() if name not in _OF_FRAMES}
    return main_command({**of_field, "styles": [parameters["style"]]}, tuning, "Viewer")


_OF_FRAMES = ("style", "method", "network", "strength", "blend", "region")
"""Parameters of a trajectory that a viewer lacks: its page itself mixes paintings."""


def tuning_of(
    parameters: Mapping[str, Any], lineage: Sequence[ActionRecord]
) -> dict[str, dict[str, Any]]:
    """Returns the settings that the user changed, by stage.

    Args:
        parameters: The other parameters of the command.
        lineage: The records of everything upstream.
    """
    tuning = {}
    for record in lineage:
        family, settings = record.action.family, _parameters(record).get("settings", {})
        if changed := _changed(family, settings, parameters):
            tuning[family] = changed
    return tuning


def _changed(
    family: str, settings: Mapping[str, Any], parameters: Mapping[str, Any]
) -> dict[str, Any]:
    """Returns the settings that are not the usual ones, without those that the others imply."""
    usual = _usual_settings(family, parameters, {})
    changed = {name: value for name, value in settings.items() if usual.get(name) != value}
    for name, value in list(changed.items()):
        others = {other: changed[other] for other in changed if other != name}
        if _usual_settings(family, parameters, others).get(name) == value:
            changed = others
    return changed


def _usual_settings(
    family: str, parameters: Mapping[str, Any], changed: Mapping[str, Any]
) -> dict[str, Any]:
    """Returns the settings of the quality, and those that a command's others imply."""
    kind = Register.get_task_cls(family)  # type: ignore[no-untyped-call]
    names = {name for name, _ in kind.get_params()}
    given = {**parameters, "settings": {}, "tuning": {family: changed}}
    stage = kind(**{name: value for name, value in given.items() if name in names})
    implied: dict[str, Any] = getattr(stage, "values", dict)()
    return settings_for(family, parameters["quality"]) | implied


def _named(lineage: Sequence[ActionRecord]) -> dict[str, ActionRecord]:
    """Returns the records by family; of a family with several, each with its digest's beginning."""
    times = Counter(record.action.family for record in lineage)

    def name(record: ActionRecord) -> str:
        family = record.action.family
        return f"{family} {record.output.digest[:8]}" if times[family] > 1 else family

    return {name(record): record for record in lineage}


def _parameters(record: ActionRecord) -> dict[str, Any]:
    parameters: Any = record.action.parameters
    return dict(parameters)


def _cost(record: ActionRecord) -> StageCost:
    provenance: Mapping[str, Any] = record.provenance
    return StageCost(
        record.action.family, float(provenance["seconds"]), int(provenance["peak_memory_bytes"])
    )


def _priors(inputs: Mapping[str, Path]) -> list[Path]:
    return sorted((inputs["priors"] / "frames").iterdir()) if "priors" in inputs else []


def _curves(inputs: Mapping[str, Path], lineage: Sequence[ActionRecord]) -> list[Curve]:
    shown = {
        "field": ("Radiance field", "PSNR of training rays, dB", "psnr"),
        "network": ("Style network", "perceptual loss", "loss"),
        "adaptation": ("Adaptation to the style", "PSNR against the priors, dB", "psnr"),
    }
    curves = {
        name: training_curve(*labels, read_rows(inputs[name] / "curve.parquet"))
        for name, labels in shown.items()
        if name in inputs and (inputs[name] / "curve.parquet").exists()
    }
    fits = (_parameters(one) for one in lineage if one.action.family == "RadianceField")
    planned = max((fit["settings"]["iterations"] for fit in fits), default=0)
    if "field" in curves:
        curves["field"] = with_note_of_its_end(curves["field"], planned)
    return list(curves.values())


def training_curve(
    title: str, quantity: str, column: str, rows: Sequence[Mapping[str, Any]]
) -> Curve:
    """Returns a column of a training's rows against the iterations."""
    at, values = ([row[name] for row in rows] for name in ("iteration", column))
    return Curve(title, quantity, at, values)


def with_note_of_its_end(curve: Curve, planned: int) -> Curve:
    """Returns the curve of a fit, and says so where the fit had other iterations than planned.

    A curve has points at equal distances, and ends less than one distance before its fit.
    """
    if len(curve.at) < 2 or not planned:
        return curve
    last, distance = curve.at[-1], curve.at[1] - curve.at[0]
    if last <= planned < last + distance:
        return curve
    change, reason = ("ended early", "no longer improved")
    if last > planned:
        change, reason = ("was extended", "still improved fast")
    note = (
        f"The fit {change}: about {last:,} iterations instead of {planned:,}, because the field"
        f" {reason} on photographs set aside."
    )
    return replace(curve, note=note)


def _error_curves(pairs: Sequence[Mapping[str, Any]]) -> list[Curve]:
    """Returns the paper's error along the trajectory with its floor, a curve for each distance."""
    return [
        Curve(
            title=term(delta).capitalize(),
            quantity="error along the flow; dashed, its floor",
            at=[pair["first"] for pair in pairs if pair["delta"] == delta],
            values=[pair["error"] for pair in pairs if pair["delta"] == delta],
            floor=[pair["floor"] for pair in pairs if pair["delta"] == delta],
            along="frame",
        )
        for delta in sorted({pair["delta"] for pair in pairs if pair["flow"]})
    ]
