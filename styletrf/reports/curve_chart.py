"""A curve of a training or a trajectory as a small inline SVG, colored by the page around it."""

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

_WIDTH, _HEIGHT = 320, 190
_LEFT, _RIGHT, _TOP, _BOTTOM = 46, 54, 10, 36
_MOST_POINTS = 240
Point: TypeAlias = tuple[float | int, float | int]


@dataclass(frozen=True, slots=True)
class Curve:
    """A quantity against the iterations of training, or against something else.

    Attributes:
        title: The name of the trained or measured thing.
        quantity: The quantity that is drawn, with its unit: `PSNR, dB`.
        at: The places of the values, ascending.
        values: The values, drawn where finite.
        floor: The best possible values at the same places; none where not known.
        along: The quantity that `at` counts.
        note: A note for the reader; none if empty.
    """

    title: str
    quantity: str
    at: Sequence[float | int]
    values: Sequence[float | int]
    floor: Sequence[float | int] = ()
    along: str = "iteration"
    note: str = ""


def curve_svg(curve: Curve) -> str:
    """Returns the `<svg>` element; empty where no value is finite.

    Curves of more than 240 points are drawn as the means of as many runs of neighbors.
    """
    points = _finite(curve.at, curve.values)
    floor = _finite(curve.at, curve.floor) if curve.floor else []
    if not points:
        return ""
    longest = float(points[-1][0]) or 1.0
    levels = [value for _, value in (*points, *floor)]
    y_ticks = ticks(min(levels), max(levels))
    name = f"{curve.quantity} of {curve.title} against {curve.along}"
    return "".join(
        [
            f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{html.escape(name)}">',
            *(_horizontal(value, y_ticks) for value in y_ticks),
            *(_below(x, longest) for x in ticks(0.0, longest) if x <= longest),
            f'<text x="{_WIDTH - _RIGHT}" y="{_HEIGHT - 4}" text-anchor="end">'
            f"{html.escape(curve.along)}</text>",
            _line("floor", floor, longest, y_ticks),
            _line("curve", points, longest, y_ticks),
            _last_value(_placed(points[-1], longest, y_ticks), points[-1][1]),
            "</svg>",
        ]
    )


def ticks(low: float | int, high: float | int, about: int = 4) -> list[float]:
    """Returns round numbers 1, 2 or 5 x 10^n apart that enclose [low, high]; two at least."""
    if high <= low:
        margin = abs(low) / 2 or 0.5
        low, high = low - margin, high + margin
    step = 10.0 ** math.floor(math.log10((high - low) / about))
    step *= next(factor for factor in (1, 2, 5, 10) if (high - low) / (step * factor) <= about)
    first, last = math.floor(low / step), math.ceil(high / step)
    return [index * step for index in range(first, last + 1)]


def short(value: float | int) -> str:
    """Returns three or four significant digits, thousands as `k`: `23.46`, `75.5k`, `2e-05`."""
    if abs(value) >= 1e4:
        return f"{value / 1e3:.3g}k" if abs(value) < 1e6 else f"{value:.3g}"
    return f"{value:.4g}" if abs(value) >= 1 else f"{value:.3g}"


def _finite(at: Sequence[float | int], values: Sequence[float | int]) -> list[Point]:
    pairs = zip(at, values, strict=True)
    points = [(x, y) for x, y in pairs if math.isfinite(x) and math.isfinite(y)]
    run = math.ceil(len(points) / _MOST_POINTS)
    groups = [points[start : start + run] for start in range(0, len(points), run or 1)]
    return [(sum(x for x, _ in g) / len(g), sum(y for _, y in g) / len(g)) for g in groups]


def _line(kind: str, points: list[Point], longest: float, y_ticks: list[float]) -> str:
    placed = (_placed(point, longest, y_ticks) for point in points)
    coordinates = " ".join(f"{x:.1f},{y:.1f}" for x, y in placed)
    return f'<polyline class="{kind}" points="{coordinates}"/>' if points else ""


def _placed(point: Point, longest: float, y_ticks: list[float]) -> tuple[float, float]:
    return _x(point[0], longest), _y(point[1], y_ticks)


def _x(second: float | int, longest: float | int) -> float:
    return _LEFT + (_WIDTH - _LEFT - _RIGHT) * second / longest


def _y(value: float | int, y_ticks: list[float]) -> float:
    up = (value - y_ticks[0]) / (y_ticks[-1] - y_ticks[0])
    return _HEIGHT - _BOTTOM - (_HEIGHT - _BOTTOM - _TOP) * up


def _horizontal(value: float | int, y_ticks: list[float]) -> str:
    y = _y(value, y_ticks)
    return (
        f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
        f'<text x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{short(value)}</text>'
    )


def _below(second: float | int, longest: float | int) -> str:
    x = _x(second, longest)
    return f'<text x="{x:.1f}" y="{_HEIGHT - 20}" text-anchor="middle">{short(second)}</text>'


def _last_value(place: tuple[float, float], value: float | int) -> str:
    x, y = place
    return (
        f'<circle class="last" cx="{x:.1f}" cy="{y:.1f}" r="3.5"/>'
        f'<text class="value" x="{x + 7:.1f}" y="{y + 4:.1f}">{short(value)}</text>'
    )
