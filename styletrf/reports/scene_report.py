"""The page to read before hours are spent on a scene: a survey of the photographs, and advice."""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from styletrf.reports.expectation import Expectation, expectation_table
from styletrf.reports.page import folded_table, section, write_page
from styletrf.scene.survey import MOST_EXPOSURE_EV, Survey

SPARSE = 0.2  # of the cells with points seen by fewer than 3 views, from which on it is a finding


@dataclass(frozen=True, slots=True)
class SceneReportContent:
    """Everything the page shows; `expected` by quality, `evidence` as `scene.json` has it.

    `doubts` speak against the poses; `machine` is the one for which `expected` holds.
    """

    scene: str
    summary: str
    survey: Survey
    unregistered: Sequence[str]
    neighbors: Mapping[str, tuple[str, str]]  # of the unregistered, in the order of the capture
    drawings: str
    model: Mapping[str, object]
    expected: Mapping[str, Expectation]
    machine: str
    evidence: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    doubts: Sequence[str] = ()


def advice(content: SceneReportContent) -> list[str]:
    """Returns advice on what to photograph again and why; none if all is well."""
    survey, said = content.survey, []
    for name in content.unregistered:
        before, after = content.neighbors[name]
        said.append(
            f"{name} has no camera: it shares too little with the others. Photograph again between "
            f"{before} and {after}, overlapping both by two thirds."
        )
    said += [f"{text[0].upper()}{text[1:]}." for text in content.doubts]
    if blurred := [view.name for view in survey.views if view.blurred]:
        said.append(f"Blurred, take again or leave out: {', '.join(blurred)}.")
    if off := [view for view in survey.views if view.off_exposure]:
        exposures = ", ".join(f"{view.name} ({view.exposure_ev:+.1f} stops)" for view in off)
        said.append(
            f"Exposed unlike the others by more than {MOST_EXPOSURE_EV} stops: {exposures}. Lock "
            "exposure and white balance."
        )
    if survey.sparse_fraction > SPARSE:
        said.append(
            f"{survey.sparse_fraction:.0%} of the parts that hold something are seen by fewer than "
            "3 photographs: more of them from more places, above all towards the edges."
        )
    return said


def write_scene_report(path: Path, content: SceneReportContent) -> None:
    """Writes the page; all text is escaped."""
    sections = [
        f"<header><div><h1>{html.escape(content.scene)} "
        '<span class="quiet">before the fit</span></h1>'
        f"<p>{html.escape(content.summary)}</p></div></header>",
        section("What to do", _advice(advice(content))),
        section("Cameras and points", f'<div class="charts">{content.drawings}</div>'),
        section("What the photographs cover", _coverage(content.survey)),
        section("What to expect here", expectation_table(content.expected, content.machine)),
        section("Photographs", _views(content.survey)),
        section("The model, and why", _model(content)),
    ]
    write_page(path, f"{content.scene} before the fit", sections)


def _advice(said: Sequence[str]) -> str:
    if not said:
        return '<div class="card"><p>Nothing: the photographs will do.</p></div>'
    items = "".join(f"<li>{html.escape(line)}</li>" for line in said)
    return f'<div class="card"><ul>{items}</ul></div>'


def _coverage(survey: Survey) -> str:
    rows = (
        ("parts with points that fewer than 3 photographs see", f"{survey.sparse_fraction:.1%}"),
        ("of the whole space", f"{survey.blind_fraction:.1%}"),
        ("photographs that see a part with points, in the middle", _middle(survey)),
    )
    return _table(rows)


def _middle(survey: Survey) -> str:
    counts = sorted(survey.seen_by[survey.has_points].tolist())
    return str(counts[len(counts) // 2]) if counts else "none"


def _views(survey: Survey) -> str:
    values = {
        view.name: f"{view.points} points, sharpness {view.sharpness:.2g}, "
        f"exposure {view.exposure_ev:+.2f} stops"
        + (", blurred" if view.blurred else "")
        + (", exposed unlike the others" if view.off_exposure else "")
        for view in survey.views
    }
    return folded_table(f"All {len(values)} with a camera", values)


def _model(content: SceneReportContent) -> str:
    folded = "".join(folded_table(name, values) for name, values in content.evidence.items())
    return _table([(name, str(value)) for name, value in content.model.items()]) + folded


def _table(rows: Sequence[tuple[str, str]]) -> str:
    body = "".join(
        f'<tr><th scope="row">{html.escape(name)}</th>'
        f'<td class="number">{html.escape(value)}</td></tr>'
        for name, value in rows
    )
    return f'<div class="card"><table><tbody>{body}</tbody></table></div>'
