"""Table 1 of the paper for scenes and styles at hand: `python benchmarks/consistency.py --help`.

    consistency.py horns fern --styles udnie mediter

Has the tasks make what is missing (draft), and prints a row of Markdown for each scene, style and
method: the field as it is meant (S3), the network on every frame, and the paper's other strategies.
Every error is followed by its floor, that of the unstylized frames; `style` is the distance of the
frames to the painting, and that of the unstylized frames.
"""

import argparse
import json
from collections.abc import Mapping
from typing import Any

import luigi
from task_of import task_of

from pipeline.task import artifact
from tasks.stages.metrics import ConsistencyMetrics
from tasks.summary.metric_labels import significant

METHODS: dict[str, dict[str, str]] = {
    "field (S3)": {},
    "per frame": {"method": "per-frame"},
    "S2": {"strategy": "s2"},
    "S1": {"strategy": "s1"},
}
COLUMNS = {
    "along the flow": ("error", "floor"),
    "along the depth": ("geometric_error", "geometric_floor"),
    "by contrast": ("normalized_error", "normalized_floor"),
    "along its own depth": ("own_error", "geometric_floor"),
    "by contrast along its own depth": ("own_normalized_error", "normalized_floor"),
    "in features": ("perceptual_error", "perceptual_floor"),
}


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--styles", nargs="+", required=True)
    parser.add_argument("--content", default="auto")
    options = parser.parse_args()
    heads = [f"{name}, {term}" for name in COLUMNS for term in ("short", "long")]
    print("| scene | style | method | " + " | ".join([*heads, "style"]) + " |")  # noqa: T201
    print("|---" * (len(heads) + 4) + "|")  # noqa: T201
    for scene in options.scenes:
        for style in options.styles:
            for name, words in METHODS.items():
                task = task_of(
                    ConsistencyMetrics, scene=scene, style=style, quality="draft",
                    content=options.content, **words,
                )  # fmt: skip
                if not luigi.build([task], local_scheduler=True, log_level="WARNING"):
                    raise SystemExit(f"{task} failed")
                summary = json.loads((artifact(task) / "summary.json").read_text())
                print(f"| {scene} | {style} | {name} | {_row(summary)} |", flush=True)  # noqa: T201


def _row(summary: Mapping[str, Any]) -> str:
    terms = [summary["delta_1"], summary["delta_5"]]
    pairs = [(t.get(error), t[floor]) for error, floor in COLUMNS.values() for t in terms]
    pairs.append((terms[0]["style_distance"], terms[0]["style_distance_unstylized"]))
    return " | ".join(
        "" if error is None else f"{significant(error)} ({significant(floor)})"
        for error, floor in pairs
    )


if __name__ == "__main__":
    main()
