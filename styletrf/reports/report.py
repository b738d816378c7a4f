"""The report of a stylized trajectory: the results, their quality, their parameters and costs.

`report.html` needs nothing beside it: videos, images, charts, styles and script are inside, so that
it can be mailed. The only link that leads out is to the viewer beside it, where there is one.
"""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from styletrf.files.video_frames import video_info
from styletrf.reports.comparison import SCRIPT, STYLE, Comparison, comparison
from styletrf.reports.curve_chart import Curve, curve_svg
from styletrf.reports.embedding import embedded_bytes, embedded_image, embedded_video
from styletrf.reports.metric_table import MetricTable, metric_table
from styletrf.reports.page import duration, folded_table, gibibytes, megabytes, section, write_page
from styletrf.reports.report_viewer import LINK, viewer_part
from styletrf.reports.report_viewer import SCRIPT as VIEWER_SCRIPT
from styletrf.reports.report_viewer import STYLE as VIEWER_STYLE

_POSTER_PX, _STYLE_PX, _PRIOR_PX = 1920, 480, 480  # longer sides, about twice what is shown


@dataclass(frozen=True, slots=True)
class StageCost:
    """The cost of a stage of the pipeline; `note` says for instance that it was reused."""

    name: str
    seconds: float | int
    peak_memory_bytes: int | None = None
    note: str = ""


@dataclass(frozen=True, slots=True)
class ReportContent:
    """Everything the page shows; a part left empty leaves its section out.

    Files are put into the page: videos as they are, images as JPEG, smaller where they are large.
    `error_curves` are curves over the frames; `parameters` go by stage; `digests` by artifact.
    `viewer_command` makes a viewer of the same field.
    """

    scene: str
    style: str
    quality: str
    summary: str = ""
    video: Path | None = None
    unstylized_video: Path | None = None
    poster: Path | None = None
    style_image: Path | None = None
    priors: Sequence[Path] = ()
    curves: Sequence[Curve] = ()
    metrics: Sequence[MetricTable] = ()
    error_curves: Sequence[Curve] = ()
    stages: Sequence[StageCost] = ()
    parameters: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    digests: Mapping[str, str] = field(default_factory=dict)
    command: str = ""
    viewer_command: str = ""


def write_report(path: Path, content: ReportContent) -> None:
    """Writes the page; the same content gives the same bytes, and all text is escaped.

    Raises:
        InputError: A file of the content is not the video or image that it should be.
        OSError: A file cannot be read.
    """
    videos, style_image = _comparison(content), _image(content.style_image, _STYLE_PX)
    priors = [_image(prior, _PRIOR_PX) for prior in content.priors]
    sections = [
        _header(content, style_image),
        comparison(videos),
        section("Priors", _priors(priors)),
        section("Metrics", _metrics(content.metrics) + _curves(content.error_curves)),
        section("Training", _curves(content.curves)),
        section("Time and memory", _costs(content.stages)),
        section("How it was made", _provenance(content)),
        section("Make it again", _command(content.command)),
        viewer_part(content.style, content.viewer_command),
        _inside(videos, [style_image, *priors]),
    ]
    title = f"{content.scene} in the style of {content.style}"
    write_page(path, title, sections, STYLE + VIEWER_STYLE, SCRIPT + VIEWER_SCRIPT)


def _comparison(content: ReportContent) -> Comparison:
    poster = _image(content.poster, _POSTER_PX)
    if not content.video:
        return Comparison(poster=poster)
    seen, other = video_info(content.video), content.unstylized_video
    return Comparison(
        video=embedded_video(content.video),
        unstylized_video=embedded_video(other) if other else "",
        poster=poster,
        aspect=seen.width / seen.height,
    )


def _image(path: Path | None, longest_px: int) -> str:
    return embedded_image(path, longest_px) if path else ""


def _header(content: ReportContent, style_image: str) -> str:
    image = f'<img src="{style_image}" alt="The style image">' if style_image else ""
    return (
        f"<header>{image}<div><h1>{html.escape(content.scene)} "
        f'<span class="quiet">in the style of</span> {html.escape(content.style)}</h1>'
        f'<p class="quiet">Quality: {html.escape(content.quality)}</p>'
        f"<p>{html.escape(content.summary)}</p>{LINK if content.viewer_command else ''}"
        "</div></header>"
    )


def _priors(priors: Sequence[str]) -> str:
    if not priors:
        return ""
    images = "".join(
        f'<img src="{prior}" alt="Stylized prior {number}">'
        for number, prior in enumerate(priors, start=1)
    )
    meaning = f"The {len(priors)} stylized views that the appearance was fitted to."
    strip = f'<div class="strip" role="group" aria-label="Priors" tabindex="0">{images}</div>'
    return f'<p class="quiet small">{meaning}</p>{strip}'


def _metrics(tables: Sequence[MetricTable]) -> str:
    return "".join(metric_table(table) for table in tables)


def _curves(curves: Sequence[Curve]) -> str:
    figures = "".join(
        f"<figure><h3>{html.escape(curve.title)}</h3>"
        f'<span class="quiet small">{html.escape(curve.quantity)}</span>{svg}'
        f'<span class="quiet small">{html.escape(curve.note)}</span></figure>'
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


def _cost_row(stage: StageCost, fraction: float) -> str:
    memory = stage.peak_memory_bytes
    note = f'<div class="quiet small">{html.escape(stage.note)}</div>' if stage.note else ""
    return (
        f'<tr><th scope="row">{html.escape(stage.name)}{note}</th>'
        f'<td class="bar"><i style="width:{100 * fraction:.1f}%"></i></td>'
        f'<td class="number">{duration(stage.seconds)}</td>'
        f'<td class="number">{"" if memory is None else gibibytes(memory)}</td></tr>'
    )


def _provenance(content: ReportContent) -> str:
    groups = {f"{stage}: parameters": values for stage, values in content.parameters.items()}
    groups |= {"Versions": content.versions, "Digests": content.digests}
    return "".join(folded_table(title, values) for title, values in groups.items() if values)


def _command(command: str) -> str:
    return f'<div class="card"><pre>{html.escape(command)}</pre></div>' if command else ""


def _inside(videos: Comparison, images: Sequence[str]) -> str:
    """Returns the sizes of the file's parts."""
    parts = {
        "the video": embedded_bytes(videos.video),
        "the unstylized one": embedded_bytes(videos.unstylized_video),
        "the images": sum(map(embedded_bytes, [videos.poster, *images])),
    }
    sizes = ", ".join(f"{name} {megabytes(size)}" for name, size in parts.items() if size)
    if not sizes:
        return ""
    return f'<footer class="quiet small">All in this one file: {sizes}.</footer>'
