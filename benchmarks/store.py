"""How fast the store is: `python benchmarks/store.py [FOLDER]`, in a folder with 2 GB to spare.

Prints hashing against `sha256sum`, and how long a grid of 100, 300 and 1,000 cells that are all
complete takes to be scheduled and found so. The grid has the shape of `tasks.Grid`: per scene a
chain of four stages, per style two, per cell four, which read from both.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

import luigi

from pipeline.canonical import Json
from pipeline.digest import file_digest
from pipeline.publication import publish
from pipeline.settings import current_store
from pipeline.task import RunContext, StoredTask

MEGABYTES = 600
STAGES_OF_A_SCENE, STAGES_OF_A_STYLE, STAGES_OF_A_CELL = 4, 2, 4


class Stage(StoredTask):
    """One stage of a scene (no style), of a style (no scene), or of a cell."""

    scene = luigi.IntParameter(default=-1)
    style = luigi.IntParameter(default=-1)
    step = luigi.IntParameter()
    revision = "1"

    def requires(self) -> Mapping[str, StoredTask]:
        """The step before, and under a cell's first what its scene and its style end in."""
        if self.step:
            return {"before": Stage(scene=self.scene, style=self.style, step=self.step - 1)}
        if -1 in (self.scene, self.style):
            return {}
        return {
            "scene": Stage(scene=self.scene, step=STAGES_OF_A_SCENE - 1),
            "style": Stage(style=self.style, step=STAGES_OF_A_STYLE - 1),
        }

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Nothing: the artifacts are published without."""


class Grid(luigi.WrapperTask):
    """The first cells of a grid with ten styles."""

    cells = luigi.IntParameter()

    def requires(self) -> list[Stage]:
        """The last stage of every cell."""
        places = [divmod(cell, 10) for cell in range(self.cells)]
        return [Stage(scene=s, style=t, step=STAGES_OF_A_CELL - 1) for s, t in places]


def publish_all(task: Stage) -> None:
    """Put into the store what the task and all above it would make."""
    if task.complete():
        return
    for upstream in task.requires().values():
        publish_all(upstream)  # type: ignore[arg-type]
    store, action = current_store(), task.action()
    with store.workspace(action.key) as workspace:
        (workspace / "out").mkdir()
        (workspace / "out" / "file").write_text(str(task))
        record: dict[str, Json] = {
            "task": str(task),
            "label": task.label,
            "started": "",
            "seconds": 0.0,
            "log": "",
        }
        publish(store, workspace / "out", action, record)


def say(line: str) -> None:
    """Write a line of the result."""
    sys.stdout.write(f"{line}\n")


def seconds_of(command: list[str]) -> float:
    """Wall-clock time of the better of two runs."""
    times = []
    for _ in range(2):
        started = time.monotonic()
        subprocess.run(command, check=True, capture_output=True)
        times.append(time.monotonic() - started)
    return min(times)


def hashing(folder: Path) -> None:
    """Print the rates of `file_digest` and of `sha256sum` on one file, in a process each."""
    file = folder / "file"
    with file.open("wb") as written:
        for _ in range(MEGABYTES):
            written.write(os.urandom(1_000_000))
    ours = "import sys, pathlib, pipeline.digest as d; d.file_digest(pathlib.Path(sys.argv[1]))"
    for name, command in {
        "sha256sum": ["sha256sum", str(file)],
        "pipeline.digest": [sys.executable, "-c", ours, str(file)],
    }.items():
        say(f"{name:16} {MEGABYTES / seconds_of(command):6.0f} MB/s")
    started = time.monotonic()
    file_digest(file)
    say(f"{'  in process':16} {MEGABYTES / (time.monotonic() - started):6.0f} MB/s")
    file.unlink()


def complete_grids() -> None:
    """Print how long `luigi` takes, all in all, to find each grid complete."""
    for cells in (100, 300, 1000):
        for task in Grid(cells=cells).requires():
            publish_all(task)
        command = ["luigi", "--module", "store", "Grid", "--cells", str(cells)]
        say(f"{cells:5} cells complete {seconds_of([sys.executable, '-m', *command]):6.2f} s")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(dir=next(iter(sys.argv[1:]), None)) as folder:
        os.environ["STYLETRF_STORE"] = str(Path(folder) / "store")
        os.environ["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parent), *sys.path])
        hashing(Path(folder))
        complete_grids()
