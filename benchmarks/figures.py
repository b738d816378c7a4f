"""Today's figures beside their targets: `python benchmarks/figures.py`.

    figures.py measure "cold draft" "new painting" --folder /tmp/figures
    figures.py table

`measure` runs commands of `targets.toml` from the root of the repository, one after the other, with
a store and results below `--folder`, and notes what they reach in `figures.json`, with commit, day
and machine. Figures that no single command measures are entered in `targets.toml`. `table` writes
the table at the beginning of `README.md` from both files. Measure with nothing beside it.
"""

import argparse
import datetime
import json
import os
import shlex
import subprocess
import time
import tomllib
from collections.abc import Iterator, Mapping
from functools import reduce
from pathlib import Path
from shutil import rmtree
from typing import Any

import psutil

from tasks.summary.trade_off_measurements import machine

HERE = Path(__file__).parent
ROOT, FIGURES, PAGE = HERE.parent, HERE / "figures.json", HERE / "README.md"
_NOTABLE = 0.03  # of the cores, taken by others
BEGIN, END = "<!-- figures: begin -->\n", "<!-- figures: end -->\n"


def runs() -> list[dict[str, Any]]:
    """Returns the commands and their targets."""
    return list(_promises()["run"])


def entered() -> dict[str, list[dict[str, Any]]]:
    """Returns the figures that no single command measures, with their targets, by subject."""
    return dict(_promises()["entered"])


def _promises() -> dict[str, Any]:
    return tomllib.loads((HERE / "targets.toml").read_text(encoding="utf-8"))


def measured(run: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Runs a command; returns its figures, and of which commit, day and machine they are.

    Raises:
        CalledProcessError: The command failed.
    """
    store, out = folder / "store", folder / "out"
    if run["store"] == "empty":
        for old in (store, out):
            rmtree(old, ignore_errors=True)
    environment = {**os.environ, "STYLETRF_STORE": str(store), "STYLETRF_OUT": str(out)}
    started, taken_s = time.monotonic(), _taken_s()
    subprocess.run(shlex.split(run["command"]), cwd=ROOT, env=environment, check=True)
    seconds = time.monotonic() - started
    fraction = (_taken_s() - taken_s) / seconds / (os.cpu_count() or 1)
    summary: dict[str, Any] = {"seconds": seconds}
    if "out" in run:
        summary |= json.loads((out / run["out"] / "summary.json").read_text())
    return {
        "figures": {figure["what"]: _value(summary, figure) for figure in run["figures"]},
        "commit": _output("git", "rev-parse", "--short", "HEAD"),
        "day": datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
        "machine": machine([]),
        "remark": f"the hypervisor took {fraction:.0%} of the cores" if fraction > _NOTABLE else "",
    }


def _taken_s() -> float:
    """Returns the seconds of all cores that the hypervisor gave to others since the start."""
    return float(getattr(psutil.cpu_times(), "steal", 0.0))


def _value(summary: Mapping[str, Any], figure: Mapping[str, Any]) -> float:
    value = _at(summary, figure["value"])
    return value / _at(summary, figure["over"]) if "over" in figure else value


def _at(summary: Mapping[str, Any], name: str) -> float:
    return float(reduce(lambda part, key: part[key], name.split("."), summary))  # type: ignore[arg-type,return-value]


def _output(*command: str) -> str:
    return subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.strip()


def table(found: Mapping[str, Any]) -> Iterator[str]:
    """Yields the usual machine and the table's lines; a figure that misses its target is marked."""
    usual = _promises()["machine"]
    yield f"A row that names no machine was measured on this one: {usual}."
    yield ""
    yield _row("what", "target", "measured", "commit, day", "command, or sections of history.md")
    yield _row(*["---"] * 5)
    yield _row("**Commands**", "", "", "", "")
    for run in runs():
        yield from _rows_of_run(run, found.get(run["name"], {"figures": {}}), usual)
    for subject, entries in entered().items():
        yield _row(f"**{subject}**", "", "", "", "")
        yield from (_entered_row(entry, usual) for entry in entries)


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _rows_of_run(run: Mapping[str, Any], of_run: Mapping[str, Any], usual: str) -> Iterator[str]:
    made = _provenance(of_run, usual)
    what, command = run["what"], f"`{run['command']}`"
    for figure in run["figures"]:
        value = of_run["figures"].get(figure["what"])
        cells = f"{what}: {figure['what']}", _target(figure), _shown(figure, value)
        yield _row(*cells, made, command)
        what, made, command = "the same", "", ""


def _entered_row(entry: Mapping[str, Any], usual: str) -> str:
    links = [f"[{title}](history.md#{name})" for title, name in entry["sections"].items()]
    figure = entry.get("figure", "not measured")
    made = _provenance(entry, usual)
    return _row(entry["what"], entry.get("target", ""), figure, made, ", ".join(links))


def _provenance(of: Mapping[str, Any], usual: str) -> str:
    parts = [of.get(name, "") for name in ("commit", "day", "machine", "remark")]
    return ", ".join(part for part in parts if part and part != usual)


def _target(figure: Mapping[str, Any]) -> str:
    bound = "at_most" if "at_most" in figure else "at_least"
    before = f" ({figure['earlier']:g} before)" if "earlier" in figure else ""
    return f"{bound.replace('_', ' ')} {figure[bound]:g}{before}"


def _shown(figure: Mapping[str, Any], value: float | None) -> str:
    if value is None:
        return "not measured"
    reached = figure.get("at_least", value) <= value <= figure.get("at_most", value)
    number = f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"
    return number if reached else f"**missed: {number}**"


def main() -> None:
    """Measures, or writes the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    measure = commands.add_parser("measure")
    measure.add_argument("names", nargs="+", choices=[run["name"] for run in runs()])
    measure.add_argument("--folder", type=Path, required=True)
    commands.add_parser("table")
    options = parser.parse_args()
    found = json.loads(FIGURES.read_text()) if FIGURES.exists() else {}
    if options.command == "measure":
        for run in runs():
            if run["name"] in options.names:
                found[run["name"]] = measured(run, options.folder)
                FIGURES.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n")
    before, _, rest = PAGE.read_text().partition(BEGIN)
    _, _, after = rest.partition(END)
    PAGE.write_text(before + BEGIN + "\n".join(table(found)) + "\n" + END + after)


if __name__ == "__main__":
    main()
