"""Measures in a table: what each means in one line, and its figures beside their floors."""

import html
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Figure:
    """A value in words; `beside` is a value to compare it with, such as its floor."""

    value: str
    beside: str = ""


@dataclass(frozen=True, slots=True)
class Metric:
    """A measure with what it means in one line, and a figure for each column of its table."""

    name: str
    meaning: str
    figures: Sequence[Figure]


@dataclass(frozen=True, slots=True)
class MetricTable:
    """Measures of one kind; `columns` are the headings of the figures in a row."""

    title: str
    columns: Sequence[str]
    metrics: Sequence[Metric]


def metric_table(table: MetricTable) -> str:
    """Returns the table as HTML, all text escaped; nothing where it has no metrics."""
    if not table.metrics:
        return ""
    head = "".join(
        f'<th scope="col" class="number">{html.escape(name)}</th>' for name in table.columns
    )
    rows = "".join(_row(metric, table.columns) for metric in table.metrics)
    return (
        f'<div class="card"><table class="metrics"><thead><tr><th scope="col">'
        f"{html.escape(table.title)}</th>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _row(metric: Metric, columns: Sequence[str]) -> str:
    cells = "".join(_cell(*pair) for pair in zip(metric.figures, columns, strict=True))
    return (
        f'<tr><th scope="row">{html.escape(metric.name)}'
        f'<div class="quiet small">{html.escape(metric.meaning)}</div></th>{cells}</tr>'
    )


def _cell(figure: Figure, column: str) -> str:
    beside = f'<div class="quiet small">{html.escape(figure.beside)}</div>' if figure.beside else ""
    return (
        f'<td class="number" data-column="{html.escape(column)}">'
        f"{html.escape(figure.value)}{beside}</td>"
    )
