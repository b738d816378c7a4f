"""Rows in Parquet and summaries in JSON, from dataclasses."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq


def write_rows(path: Path, rows: Sequence[Any]) -> None:
    """Writes dataclasses (or mappings) of one kind as a Parquet table, a column a field.

    NaN becomes an empty field, which tools leave out of a mean.
    """
    flat = [dict(row) if isinstance(row, Mapping) else asdict(row) for row in rows]
    pq.write_table(pa.Table.from_pylist([_defined(row) for row in flat]), path)


def write_curve(path: Path, points: Sequence[Any]) -> None:
    """Writes the measures of a training by iteration, without the `seconds` that it took.

    So equal results have equal bytes, and results made of them stay valid; the record has the time.
    """
    rows = (asdict(point) for point in points)
    write_rows(path, [{n: v for n, v in row.items() if n != "seconds"} for row in rows])


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Returns the rows of a Parquet table as dictionaries."""
    rows: list[dict[str, Any]] = pq.read_table(path).to_pylist()
    return rows


def write_summary(path: Path, summary: Mapping[str, Any]) -> None:
    """Writes a JSON object with sorted keys; an infinite or undefined number becomes null."""
    text = json.dumps(_finite(summary), indent=1, sort_keys=True, allow_nan=False)
    path.write_text(text + "\n")


def read_summary(path: Path) -> dict[str, Any]:
    """Returns the JSON object that `write_summary` wrote."""
    summary: dict[str, Any] = json.loads(path.read_text())
    return summary


def _defined(row: Mapping[str, Any]) -> dict[str, Any]:
    return {n: None if isinstance(v, float) and math.isnan(v) else v for n, v in row.items()}


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value
