"""The page of a trade-off: its front to point at, the answers with their commands, all variants."""

import html
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from styletrf.errors import InputError
from styletrf.evaluation.pareto_front import FrontPoint, best_in, fastest_within, smallest_within
from styletrf.evaluation.trade_off import Combination, Measurement, Spread, Tuning, spread_of
from styletrf.reports.page import duration, gibibytes, section, write_page
from styletrf.reports.trade_off.chart import busy_words, description, front_svg

STYLE = Path(__file__).with_name("trade_off.css").read_text(encoding="utf-8")
SCRIPT = Path(__file__).with_name("trade_off.js").read_text(encoding="utf-8")


@dataclass(frozen=True, slots=True)
class TradeOffContent:
    """Everything the page shows; `command` returns the command for some settings and stylizer."""

    scene: str
    style: str
    quality: str
    space: str
    machine: str
    measured: str
    changes: str
    points: Sequence[Combination]
    front: Sequence[FrontPoint]
    measurements: Sequence[Measurement]
    command: Callable[[Tuning, str], str]


QUESTIONS: dict[str, Callable[[Sequence[Combination]], Combination]] = {
    "The fastest within 0.5 dB of the best": lambda points: fastest_within(points, 0.5),
    "The best in 5 minutes": lambda points: best_in(points, 300.0),
    "The smallest within 1 dB of the best": lambda points: smallest_within(points, 1.0),
}


def write_trade_off_page(path: Path, content: TradeOffContent) -> None:
    """Writes the page; it needs no other file."""
    title = f"{content.scene}: time and accuracy"
    counts = (
        f"{html.escape(content.changes)} of the sweep about <b>{html.escape(content.quality)}</b>, "
        f"{len(content.points)} combinations, {len(content.front)} of them on the front. "
        f"Scene in {html.escape(content.space)} space, style {html.escape(content.style)}, "
        f"measured on {html.escape(content.measured)}, {html.escape(content.machine)}."
    )
    chart = (
        f'<div class="card">{front_svg(content.points, content.front)}</div>'
        '<pre class="card description small" aria-live="polite">'
        "Point at a circle, or move to one with the Tab key, to read here what it is.</pre>"
        '<p class="quiet small">Filled: on the front. Hollow: on it, but not distinguishable from '
        f"its neighbor. Gray: another is faster and nearer to the best. {_noise(content)}</p>"
    )
    sections = [
        f"<header><div><h1>{html.escape(title)}</h1><p>{counts}</p></div></header>",
        chart,
        section("Answers", "".join(_answer(content, question) for question in QUESTIONS)),
        section("The scene: what one change does", _table(content.measurements, "scene")),
        section("The style: what one change does", _table(content.measurements, "style")),
    ]
    write_page(path, title, sections, STYLE, SCRIPT)


def _noise(content: TradeOffContent) -> str:
    spread: Spread = spread_of(content.measurements)
    if not spread.quality_db:
        return "Nothing was measured twice, so how sure the figures are is not known."
    sides = ", ".join(f"{part} {db:.2f} dB" for part, db in spread.quality_db.items())
    return f"Repeats with other seeds differ by (one standard deviation) {sides}."


def _answer(content: TradeOffContent, question: str) -> str:
    asked = f"<h3>{html.escape(question)}</h3>"
    try:
        point = QUESTIONS[question](content.points)
    except InputError:
        return f"{asked}<p>None of the combinations.</p>"
    lines = "<br>".join(html.escape(line) for line in description(point)[:-1])
    command = f"<pre>{html.escape(content.command(point.tuning, point.stylizer))}</pre>"
    return f'{asked}<p class="small">{lines}</p><div class="card">{command}</div>'


def _table(measurements: Sequence[Measurement], part: str) -> str:
    side = [m for m in measurements if m.part == part]
    if not side:
        return ""
    usual = side[0]
    rows = "".join(_row(m, usual) for m in side)
    unit = "PSNR" if part == "scene" else "style"
    names = [unit, "change", "time", "memory", "kept", *["error over floor"] * (part == "style")]
    head = "".join(f'<th class="number">{name}</th>' for name in names)
    return (
        f'<div class="card"><table><thead><tr><th>changed</th>{head}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )


def _row(measurement: Measurement, usual: Measurement) -> str:
    seconds = sum(measurement.seconds.values())
    load = busy_words(measurement.other_cpu_share).removeprefix(", ")
    busy = f'<div class="quiet small">{load}</div>' if load else ""
    ratio = measurement.consistency_ratio
    consistency = [f"{ratio:.2f}" if ratio else "unknown"] if measurement.part == "style" else []
    values = (
        f"{measurement.quality_db:.2f} dB",
        f"{measurement.quality_db - usual.quality_db:+.2f}",
        duration(seconds),
        gibibytes(measurement.peak_memory_bytes),
        f"{sum(measurement.model_bytes.values()) / 1e6:.0f} MB",
        *consistency,
    )
    cells = "".join(f'<td class="number">{value}</td>' for value in values)
    name = html.escape(measurement.name or "nothing")
    return f'<tr><th scope="row">{name}{busy}</th>{cells}</tr>'
