"""What exported splats, points and meshes hold and lose: a table of `export.json` of each format.

python benchmarks/exports.py horns mosaic --quality draft --formats spz mesh

The stages are those of `luigi --module tasks Export` with the same words, which has to have run.
"""

import argparse
import json

from task_of import task_of

from pipeline.task import artifact
from tasks.results.export import Export


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene")
    parser.add_argument("styles", nargs="*")
    parser.add_argument("--quality", default="draft")
    parser.add_argument("--content", default="auto")
    parser.add_argument("--tuning", type=json.loads, default={})
    parser.add_argument("--formats", nargs="*", default=["spz", "ply", "points", "mesh"])
    given = parser.parse_args()
    print("| format | what | MB | PSNR to the field | against photographs, field |")  # noqa: T201
    print("|---|---|---|---|---|")  # noqa: T201
    for file_format in given.formats:
        export = task_of(
            Export, scene=given.scene, styles=given.styles, format=file_format,
            quality=given.quality, content=given.content, tuning=given.tuning,
        )  # fmt: skip
        folder = artifact(export)
        report = json.loads((folder / "export.json").read_text())
        for file in sorted(folder.glob("*.*")):
            if file.suffix in (".ply", ".spz", ".glb"):
                loss = report.get("looks", {}).get(file.stem, {})
                psnr = f"{loss['psnr_to_field']:.2f} dB" if loss else ""
                names = [name for name in ("splats_psnr", "field_psnr") if name in loss]
                both = [f"{loss[name]:.2f}" for name in names]
                size = f"{file.stat().st_size / 1e6:.2f}"
                row = (file_format, contents(report, file.stem), size, psnr, ", ".join(both))
                print(f"| {' | '.join(row)} |")  # noqa: T201


def contents(report: dict[str, object], name: str) -> str:
    """Returns what a file holds."""
    counts = [f"{report[k]:,} {k}" for k in ("splats", "points", "triangles") if k in report]
    return f"{name}: {', '.join(counts)}"


if __name__ == "__main__":
    main()
