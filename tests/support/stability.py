"""The stability report: what the tests of numerical extremes found, as one table.

A test that is marked `extremes("module")` states a law in its name and is in the report. With the
fixture `stability` it compares what a case gives with what the same gives in float64, within a
bound; a larger error fails the test.
`pytest -m extremes --stability PATH` writes the table (`make stability`).
"""

import functools
import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

COMMITTED = Path(__file__).parents[2] / "docs/stability.md"
OPTION, PROPERTY = "--stability", "stability"
ROUNDING = 1e-16  # of float64: an error below counts as none
HEADER = "| what holds | case | precision | values | error | bound |\n|---|---|---|---|---|---|\n"
BOUNDS = {"float64": 1e-11, "float32": 1e-5, "float16": 2e-3, "bfloat16": 3e-2}
"""The largest error of a case that names no bound of its own, by precision."""
STALE = "docs/stability.md has no such case; `make stability` writes it again"
PREFACE = """# Numerical extremes

`make stability` writes this page.
The error is the largest deviation from a computation or a closed form in float64.
It is relative to the largest value of that, or absolute if that is zero or the row says so.
It is rounded up to a power of ten.
A row has the worst error of its kernels and parameters.
The tests assert each bound.
A row without an error states a law that has none.
"""


@dataclass(frozen=True)
class Row:
    """One line of the table: a law of a module, and one of the cases it was tried on."""

    module: str
    file: str
    line: int
    law: str
    case: str = "-"
    precision: str = "-"
    values: str = "holds"
    error: float | None = None
    bound: float | None = None


Cases = Callable[..., None]


def half_rounding(size: float) -> float:
    """Returns the largest error of values up to `size` in half precision, relative to `size`.

    Halves are 1 in 1024 apart, below 6e-5 all 6e-8. What is below half of that becomes 0.
    """
    return max(2.0**-11, min(1.0, 2.0**-25 / size)) if size else 0.0


@pytest.fixture
def stability(request: pytest.FixtureRequest, record_property: Callable[..., None]) -> Cases:
    """Compares a case with what is exact, both tensors, arrays or numbers, and asserts the bound.

    `within` is the bound where it is not that of `BOUNDS`; an `absolute` error is not divided by
    the largest value. The committed report has to have the case, unless it is written now.
    """
    writes_report = request.config.getoption(OPTION) is not None

    def case(
        name: str, found: Any, exact: Any,
        *, precision: str | None = None, within: float | None = None, absolute: bool = False,
    ) -> None:  # fmt: skip
        name = re.sub(r"e\+?(-?)0*(\d)", r"e\1\2", name)  # 1e+30 is 1e30
        precision = precision or _dtype(found)
        bound = BOUNDS[precision] if within is None else within
        values, reference = _numbers(found), _numbers(exact)
        error = deviation(values, reference, absolute=absolute)
        row = Row(*_law(request.node), name, precision, _kind(values), error, bound)
        record_property(PROPERTY, astuple(row))
        assert error <= bound, f"{name} in {precision}"
        assert writes_report or (row.law, name, precision) in _committed(), f"{STALE}: {name}"

    return case


@functools.cache
def _committed() -> set[tuple[str, str, str]]:
    """Returns the law, the case and the precision of each row of the committed report."""
    rows, law = set(), ""
    for line in COMMITTED.read_text().splitlines():
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if len(cells) == HEADER.splitlines()[0].count("|") - 1:
            law = cells[0] or law
            rows.add((law, cells[1], cells[2]))
    return rows


def deviation(found: np.ndarray, exact: np.ndarray, *, absolute: bool = False) -> float:
    """Returns the largest deviation over the largest finite magnitude of what is exact, or alone.

    The same infinity, and NaN where there is to be NaN, are no deviation.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        same = (found == exact) | (np.isnan(found) & np.isnan(exact))
        difference = np.where(same, 0.0, np.abs(found - exact))
    finite = np.abs(exact[np.isfinite(exact)])
    scale = 1.0 if absolute else float(finite.max(initial=0.0)) or 1.0
    largest = float(difference.max(initial=0.0)) / scale
    return math.inf if math.isnan(largest) else largest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(OPTION, type=Path, help="where to write the table of numerical extremes")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption(OPTION) and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Report(config.getoption(OPTION)))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """Notes the law of a test that compared no cases, and of one that failed."""
    report = yield
    if report.when == "call" and item.get_closest_marker("extremes") and not report.skipped:
        compared = [value for name, value in report.user_properties if name == PROPERTY]
        if report.failed or not compared:
            outcome = "FAILED" if report.failed else "holds"
            report.user_properties.append((PROPERTY, astuple(Row(*_law(item), values=outcome))))
    return report


class Report:
    """Gathers the rows of all tests, and writes them when the session ends."""

    def __init__(self, path: Path) -> None:
        self.path, self.rows = path, list[Row]()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call":
            found = (value for name, value in report.user_properties if name == PROPERTY)
            self.rows.extend(Row(*value) for value in found)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        table = in_markdown(self.rows)
        self.path.write_text(table)
        terminalreporter.write(f"\n{table}")


def in_markdown(rows: Iterable[Row]) -> str:
    """Returns the table, a section a module; of rows that differ in the error alone the worst."""
    worst: dict[tuple[str, ...], Row] = {}
    for row in rows:
        key = astuple(row)[:-2]
        if key not in worst or (row.error or 0) > (worst[key].error or 0):
            worst[key] = row
    text, module, law = PREFACE, "", ""
    for row in sorted(worst.values(), key=lambda row: (row.module, row.file, row.line)):
        if row.module != module:
            module, law = row.module, ""
            text += f"\n## {module}\n\n{HEADER}"
        shown = "" if row.law == law else row.law
        law = row.law
        bound = "-" if row.bound is None else f"{row.bound:.0e}".replace("e-0", "e-")
        cells = shown, row.case, row.precision, row.values, _order(row), bound
        text += f"| {' | '.join(cells)} |\n"
    return text


def law_in_words(test: str) -> str:
    """Returns the law that a test is named after."""
    return test.removeprefix("test_").partition("[")[0].replace("_", " ")


def _law(item: pytest.Item) -> tuple[str, str, int, str]:
    marker, (file, line, _) = item.get_closest_marker("extremes"), item.location
    if marker is None:
        raise ValueError(f"{item.name} is not marked as of the extremes of a module")
    return marker.args[0], file, line or 0, law_in_words(item.name)


def _numbers(values: Any) -> np.ndarray:
    if isinstance(values, torch.Tensor):
        values = values.detach().cpu().double().numpy()
    return np.asarray(values, dtype=np.float64)


def _dtype(values: Any) -> str:
    return str(values.dtype).removeprefix("torch.") if hasattr(values, "dtype") else "float64"


def _kind(values: np.ndarray) -> str:
    if not values.any():
        return "zero"
    kinds = {"NaN": np.isnan(values), "infinite": np.isinf(values), "finite": np.isfinite(values)}
    return " and ".join(kind for kind, where in kinds.items() if where.any())


def _order(row: Row) -> str:
    if row.error is None:
        return "-"
    if row.error < ROUNDING or math.isinf(row.error):
        return "0" if row.error < ROUNDING else "infinite"
    return f"1e{math.ceil(math.log10(row.error))}"
