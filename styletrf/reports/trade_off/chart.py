"""Combinations as points over time and shortfall, those on the front drawn out; an inline SVG."""

import html
import json
import math
from collections.abc import Sequence

from styletrf.evaluation.pareto_front import FrontPoint
from styletrf.evaluation.trade_off import BUSY_FRACTION, Combination
from styletrf.reports.curve_chart import ticks
from styletrf.reports.page import duration, gibibytes

_WIDTH, _HEIGHT = 720, 420
_LEFT, _RIGHT, _TOP, _BOTTOM = 56, 18, 14, 44


def front_svg(points: Sequence[Combination], front: Sequence[FrontPoint]) -> str:
    """Returns the `<svg>`: seconds on a logarithmic axis, decibels short of the best downwards.

    A point is a focusable circle whose `<title>` and `data-description` describe it; those that are
    beaten are gray, those on the front have a bar of one standard deviation of their time.
    """
    chosen = {id(point.combination) for point in front}
    axes = _Axes(points)
    beaten = [p for p in points if id(p) not in chosen]
    line = " ".join(axes.place(p.combination.seconds, p.combination.shortfall_db) for p in front)
    return "".join(
        [
            f'<svg class="front" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" '
            'aria-label="Decibels short of the best against time">',
            *axes.lines(),
            *(_circle(axes, p, "beaten", 3) for p in beaten),
            f'<polyline class="curve" points="{line}"/>',
            *(_spread(axes, p.combination) for p in front),
            *(_circle(axes, p.combination, _kind(p), 6) for p in front),
            "</svg>",
        ]
    )


def description(point: Combination) -> list[str]:
    """Returns the lines that describe a point."""
    spread = f" ± {point.seconds_spread:.0f} s" if point.seconds_spread else ""
    busy = busy_words(point.other_cpu_share)
    ratio = point.consistency_ratio
    consistency = f", temporal error {ratio:.2f} times that of unstylized frames" if ratio else ""
    return [
        f"{duration(point.seconds)}{spread}, {point.shortfall_db:.2f} dB short of the best{busy}",
        f"scene: {point.scene or 'as it is'}; style: {point.style or 'as it is'}",
        f"{point.psnr_db:.2f} dB on views held out, style {point.style_db:.2f} dB{consistency}",
        f"{gibibytes(point.peak_memory_bytes)} of memory, {point.model_bytes / 1e6:.0f} MB kept",
        json.dumps(point.tuning),
    ]


def busy_words(other_cpu_share: float | None) -> str:
    """Returns that other work disturbed a measurement, or that nobody knows; nothing if neither."""
    if other_cpu_share is None:
        return ", beside unknown work"
    if other_cpu_share > BUSY_FRACTION:
        return f", beside other work: {other_cpu_share:.0%}"
    return ""


def _kind(point: FrontPoint) -> str:
    return "best overlaps" if point.overlaps else "best"


def _circle(axes: "_Axes", point: Combination, kind: str, radius: int) -> str:
    lines = html.escape("\n".join(description(point)), quote=True)
    x, y = axes.place(point.seconds, point.shortfall_db).split(",")
    focus = ' tabindex="0"' if kind.startswith("best") else ""
    return (
        f'<circle class="{kind}" cx="{x}" cy="{y}" r="{radius}"{focus} data-description="{lines}">'
        f"<title>{lines}</title></circle>"
    )


def _spread(axes: "_Axes", point: Combination) -> str:
    spread = point.seconds_spread or 0.0
    ends = (point.seconds - spread, point.seconds + spread)
    left, right = (axes.place(max(s, 1e-3), point.shortfall_db) for s in ends)
    return f'<polyline class="spread" points="{left} {right}"/>'


class _Axes:
    """The positions of seconds and decibels on the page."""

    def __init__(self, points: Sequence[Combination]) -> None:
        seconds = [point.seconds for point in points]
        self._first = math.log(0.93 * min(seconds))
        self._last = math.log(1.07 * max(seconds))
        worst = max(0.1, *(point.shortfall_db for point in points))
        self._ticks = [tick for tick in ticks(0.0, worst) if tick >= 0]

    def place(self, seconds: float, shortfall_db: float) -> str:
        fraction = (math.log(seconds) - self._first) / (self._last - self._first)
        x = _LEFT + min(max(fraction, 0.0), 1.0) * (_WIDTH - _LEFT - _RIGHT)
        return f"{x:.1f},{self._y(shortfall_db):.1f}"

    def _y(self, shortfall_db: float) -> float:
        return _TOP + shortfall_db / (self._ticks[-1] or 1.0) * (_HEIGHT - _TOP - _BOTTOM)

    def lines(self) -> list[str]:
        """Returns the grid and its labels."""
        across = [
            f'<line x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
            f'<text x="{_LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{-t or 0:g}</text>'
            for t, y in ((t, self._y(t)) for t in self._ticks)
        ]
        below = []
        for seconds in _round_seconds(math.exp(self._first), math.exp(self._last)):
            x = self.place(seconds, 0.0).split(",")[0]
            below.append(
                f'<text x="{x}" y="{_HEIGHT - 24}" text-anchor="middle">{duration(seconds)}</text>'
            )
        words = f'<text x="{_WIDTH - _RIGHT}" y="{_HEIGHT - 6}" text-anchor="end">time</text>'
        side = f'<text x="4" y="{_HEIGHT - 6}">dB against the best</text>'
        return [*across, *below, words, side]


def _round_seconds(first: float, last: float) -> list[float]:
    """Returns round times, at most about eight between the two."""
    steps = [60, 90, 120, 180, 240, 300, 420, 600, 900, 1200, 1800, 2700, 3600, 5400, 7200]
    small = [0.1 * s for s in steps[:1]] + [10, 15, 20, 30, 45]
    large = [3600 * h for h in (3, 4, 6, 8, 12, 24, 48, 96)]
    return [float(s) for s in [*small, *steps, *large] if first <= s <= last]
