"""The page that goes with a stylised trajectory: what was made, how well, how, and at what cost.

`report.html` needs nothing but the files beside it: styles, script and charts are inside, videos
and images are named relative to it. No link leads out of its folder.
"""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from urllib.parse import quote

from styletrf.curve_chart import Curve, curve_svg
from styletrf.page import duration, folded_table, gibibytes, section, write_page


@dataclass(frozen=True, slots=True)
class Metric:
    """A number with what it means in one line, and the best that was attainable, if known."""

    name: str
    value: str
    meaning: str
    floor: str = ""


@dataclass(frozen=True, slots=True)
class StageCost:
    """What a stage of the pipeline took; `note` says for instance that it was reused."""

    name: str
    seconds: float | int
    peak_memory_bytes: int | None = None
    note: str = ""


@dataclass(frozen=True, slots=True)
class ReportContent:
    """Everything the page shows; a part left empty leaves its section out.

    Files are named relative to the page, with `/`. `parameters` go by stage; `digests` by artifact.
    """

    scene: str
    style: str
    quality: str
    summary: str = ""
    video: str = ""
    unstylized_video: str = ""
    poster: str = ""
    style_image: str = ""
    priors: Sequence[str] = ()
    curves: Sequence[Curve] = ()
    metrics: Sequence[Metric] = ()
    stages: Sequence[StageCost] = ()
    parameters: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    digests: Mapping[str, str] = field(default_factory=dict)
    command: str = ""


def write_report(path: Path, content: ReportContent) -> None:
    """Writes the page; the same content gives the same bytes, and all text is escaped.

    Raises:
        ValueError: A file of the content is not named relative to the page, or is above it.
    """
    sections = [
        _header(content),
        _stage(content),
        section("Priors", _priors(content.priors)),
        section("Metrics", _metrics(content.metrics)),
        section("Training", _curves(content.curves)),
        section("Time and memory", _costs(content.stages)),
        section("How it was made", _provenance(content)),
        section("Make it again", _command(content.command)),
    ]
    write_page(path, f"{content.scene} in the style of {content.style}", sections)


def _header(content: ReportContent) -> str:
    image = ""
    if content.style_image:
        image = f'<img src="{_address(content.style_image)}" alt="The style image">'
    return (
        f"<header>{image}<div><h1>{html.escape(content.scene)} "
        f'<span class="quiet">in the style of</span> {html.escape(content.style)}</h1>'
        f'<p class="quiet">Quality: {html.escape(content.quality)}</p>'
        f"<p>{html.escape(content.summary)}</p></div></header>"
    )


def _stage(content: ReportContent) -> str:
    poster = f' poster="{_address(content.poster)}"' if content.poster else ""
    if not content.video:
        image = f'<img src="{_address(content.poster)}" alt="A frame of the stylised trajectory">'
        return f'<div class="stage">{image}</div>' if content.poster else ""
    common = f'muted loop playsinline preload="auto"{poster}'
    stylized = f'<video src="{_address(content.video)}" {common}'
    if not content.unstylized_video:
        return f'<div class="stage">{stylized} controls autoplay></video></div>'
    unstylized = f'<video class="before" src="{_address(content.unstylized_video)}" muted loop'
    return (
        f'<div class="stage"><div class="compare">{stylized}></video>'
        f'{unstylized} playsinline preload="auto"></video>'
        '<span class="label" style="left:.7rem">before</span>'
        '<span class="label" style="right:.7rem">stylised</span><div class="edge"></div>'
        '<input class="split" type="range" min="0" max="100" value="50" step="0.1" '
        'aria-label="Where the unstylised video ends and the stylised one begins"></div>'
        '<div class="controls"><button type="button">Play</button>'
        '<input class="seek" type="range" min="0" max="1" value="0" step="0.001" '
        'aria-label="Time"></div></div>'
    )


def _priors(priors: Sequence[str]) -> str:
    if not priors:
        return ""
    images = "".join(
        f'<img src="{_address(name)}" alt="Stylised prior {number}" loading="lazy">'
        for number, name in enumerate(priors, start=1)
    )
    meaning = f"The {len(priors)} stylised views that the appearance was fitted to."
    return f'<p class="quiet small">{meaning}</p><div class="strip" tabindex="0">{images}</div>'


def _metrics(metrics: Sequence[Metric]) -> str:
    rows = "".join(
        f'<tr><th scope="row">{html.escape(metric.name)}</th>'
        f'<td class="number">{html.escape(metric.value)}</td>'
        f'<td class="number floor">{html.escape(metric.floor)}</td>'
        f'<td class="quiet small">{html.escape(metric.meaning)}</td></tr>'
        for metric in metrics
    )
    head = (
        '<tr><th>measure</th><th class="number">value</th><th class="number">floor</th>'
        "<th>what it means</th></tr>"
    )
    table = f'<table class="metrics"><thead>{head}</thead><tbody>{rows}</tbody></table>'
    return f'<div class="card">{table}</div>' if metrics else ""


def _curves(curves: Sequence[Curve]) -> str:
    figures = "".join(
        f"<figure><h3>{html.escape(curve.title)}</h3>"
        f'<span class="quiet small">{html.escape(curve.quantity)}</span>{svg}</figure>'
        for curve in curves
        if (svg := curve_svg(curve))
    )
    return f'<div class="charts">{figures}</div>' if figures else ""


def _costs(stages: Sequence[StageCost]) -> str:
    longest = max((stage.seconds for stage in stages), default=0) or 1
    rows = "".join(_cost_row(stage, stage.seconds / longest) for stage in stages)
    total = duration(sum(stage.seconds for stage in stages))
    foot = f'<tr><th>all</th><td class="bar"></td><td class="number">{total}</td><td></td></tr>'
    table = f'<table class="costs"><tbody>{rows}{foot}</tbody></table>'
    return f'<div class="card">{table}</div>' if stages else ""


def _cost_row(stage: StageCost, share: float) -> str:
    memory = stage.peak_memory_bytes
    note = f'<div class="quiet small">{html.escape(stage.note)}</div>' if stage.note else ""
    return (
        f'<tr><th scope="row">{html.escape(stage.name)}{note}</th>'
        f'<td class="bar"><i style="width:{100 * share:.1f}%"></i></td>'
        f'<td class="number">{duration(stage.seconds)}</td>'
        f'<td class="number">{"" if memory is None else gibibytes(memory)}</td></tr>'
    )


def _provenance(content: ReportContent) -> str:
    groups = {f"{stage}: parameters": values for stage, values in content.parameters.items()}
    groups |= {"Versions": content.versions, "Digests": content.digests}
    return "".join(folded_table(title, values) for title, values in groups.items() if values)


def _command(command: str) -> str:
    return f'<div class="card"><pre>{html.escape(command)}</pre></div>' if command else ""


def _address(name: str) -> str:
    """The name as a relative URL; quoting leaves no room for a scheme or an attribute's end."""
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts:
        raise ValueError(f"{name} is not a file beside or below the report")
    return quote(str(path))
