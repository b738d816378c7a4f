"""What every knob of the field costs and buys: one fit with it changed, beside one without.

    knobs.py run horns fern lego --rows rows.jsonl --iterations 1500
    knobs.py table --rows rows.jsonl

Rows that the file already has are not measured again. Fits of a few hundred iterations scatter by
half a decibel and tell nothing. A fit's time is that of one thread's CPU
where `NUMBA_NUM_THREADS=1 OMP_NUM_THREADS=1` are set, so that several can run side by side. A frame
is measured on the first held-out view of the scene's unchanged fit.
"""

import argparse
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from field import EXHAUSTIVE, colors, frame_row, measurements, settings_of
from given_scenes import GivenScene, load_given_scene

from styletrf.field.radiance_field import RadianceField, load_field
from styletrf.field.rendering import RenderConfig

FIT: dict[str, list[Any]] = {
    "model.max_voxels": [128**3, 320**3],
    "training.field.density_ranks": [[8], [24], [16, 16, 16], [16, 4, 4]],
    "training.field.appearance_ranks": [[12], [48]],
    "training.field.features": [12, 48],
    "training.field.hidden": [32, 128],
    "training.steps_per_voxel": [0.35, 1.4],
    "training.min_weight": [0.001, 0.01],
    "training.termination": [0.001, 0.01],
    "training.occupancy_alpha": [0.005, 0.05],
    "training.batch": [768, 3072],
    "training.iterations": [0.5, 2.0],  # times those asked for
    "training.factor_rate": [0.015, 0.06],
    "training.gradient_threshold": [0.0, 10.0],
    "training.color_threshold": [0.0, 3.0],
    "training.tv_density": [0.0, 0.03],
    "training.tv_appearance": [0.0, 0.01],
}
FRAME = [(1e-3, 1e-3), (3e-3, 5e-3), (1e-2, 5e-3), (3e-3, 1e-2), (1e-2, 1e-2), (1e-2, 2e-2)]


def runs(iterations: int) -> Iterator[tuple[str, Any]]:
    """Yields a knob and its value, the unchanged fit first."""
    yield "", None
    for knob, values in FIT.items():
        for value in values:
            yield knob, round(value * iterations) if knob.endswith("iterations") else value


def measured(options: argparse.Namespace) -> None:
    """Measures what the file does not have."""
    for scene in options.scenes:
        for knob, value in runs(options.iterations):
            setting = {"iterations": options.iterations}
            key = {"scene": scene, "knob": knob, "value": value} | setting
            if any(key.items() <= row.items() for row in rows_of(options.rows)):
                continue
            for row in _fit(scene, knob, value, options.iterations):
                with options.rows.open("a") as file:
                    file.write(json.dumps(key | row) + "\n")


def _fit(scene: str, knob: str, value: Any, iterations: int) -> Iterator[dict[str, Any]]:
    changes = [f"training.iterations={iterations}", "training.shrink_rise=0.0"]
    if knob:
        changes.append(f"{knob}={json.dumps(value)}")
    settings = settings_of(argparse.Namespace(quality="draft", seed=0, set=changes))
    given = load_given_scene(scene, settings.model)
    with TemporaryDirectory() as folder:
        yield from measurements(given, settings, None, [], Path(folder))
        if not knob:
            yield from _frames(given, load_field(Path(folder)))


def _frames(scene: GivenScene, radiance: RadianceField) -> Iterator[dict[str, Any]]:
    exhaustive = next(colors(scene, radiance, EXHAUSTIVE, slice(1)))
    for termination, min_weight in FRAME:
        render = RenderConfig(termination, min_weight)
        row = frame_row(scene, radiance, exhaustive, render, repeats=3)
        yield {"knob": "frame", "value": [termination, min_weight]} | row


def rows_of(path: Path) -> list[dict[str, Any]]:
    """Returns the rows measured so far."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def table(options: argparse.Namespace) -> None:
    """Prints Markdown: PSNR and CPU time of each change, less and over those without it."""
    rows = rows_of(options.rows)
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    print("| knob | value |" + "".join(f" {s}: dB | time |" for s in scenes))  # noqa: T201
    print("|---|---|" + "---|---|" * len(scenes))  # noqa: T201
    keys = dict.fromkeys((row["knob"], json.dumps(row["value"])) for row in rows)
    for knob, value in keys:
        cells = [_cells(rows, scene, knob, value) for scene in scenes]
        print(f"| {knob or '(unchanged)'} | {value} |" + "".join(cells))  # noqa: T201


def _cells(rows: Iterable[dict[str, Any]], scene: str, knob: str, value: str) -> str:
    of_scene = [row for row in rows if row["scene"] == scene]
    base = next(row for row in of_scene if not row["knob"])
    same = [r for r in of_scene if r["knob"] == knob and json.dumps(r["value"]) == value]
    if not same:
        return " | |"
    row = same[0]
    if not knob:
        return f" {row['psnr']:.2f} | {row['cpu_ms_per_iteration']:.0f} ms |"
    if knob == "frame":
        return f" {row['psnr']:.2f} | {row['cpu_seconds']:.2f} s |"
    return (
        f" {row['psnr'] - base['psnr']:+.2f} | x {row['cpu_seconds'] / base['cpu_seconds']:.2f} |"
    )


def main() -> None:
    """Runs the mode that the command line names."""
    result = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    modes = result.add_subparsers(required=True)
    run = modes.add_parser("run", help=measured.__doc__)
    run.add_argument("scenes", nargs="+")
    run.add_argument("--iterations", type=int, default=1500)
    run.set_defaults(run=measured)
    show = modes.add_parser("table", help=table.__doc__)
    show.set_defaults(run=table)
    for mode in (run, show):
        mode.add_argument("--rows", type=Path, required=True)
    options = result.parse_args()
    options.run(options)


if __name__ == "__main__":
    main()
