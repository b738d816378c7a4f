"""Grids of small courtyards with tiny settings, as commands of their own: for soaks and timings.

python tests/support/small_grids.py --workers 2        how much more two builds at once get done
python tests/support/small_grids.py --soak-minutes 60  random kills; nothing may be lost (make soak)
"""

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil
from luigid_process import Luigid

from pipeline.locks import is_held
from pipeline.maintenance.attempts import attempts
from pipeline.maintenance.verify import problems
from pipeline.store import Store
from styletrf.synthetic.courtyard.capture import CourtyardConfig
from styletrf.synthetic.courtyard.folder import write_courtyard

ROOT = Path(__file__).parents[2]
STYLES = ("brush", "dots", "ink_waves", "stained_glass")
TUNING = {
    "SceneModel": {"image_long_side": 64, "max_voxels": 24**3},
    "RadianceField": {
        "iterations": 200, "batch": 256, "initial_voxels": 16**3, "upsample_at": [0.3],
        "occupancy_every": 20,
    },
    "ContentImages": {"count": 16},
    "StyleNetwork": {
        "network.width": 4, "network.n_residual": 1, "iterations": 40, "identity_iterations": 0,
        "batch": 1, "crop_px": 32, "style_px": 64,
    },
    "PriorRenders": {"trajectory.frames": 6},
    "TrajectoryFrames": {"trajectory.frames": 6},
    "StylizedField": {"adaptation.iterations": 60, "adaptation.batch": 256},
}  # fmt: skip


@dataclass(frozen=True)
class GridRun:
    """Scenes, styles, and a folder for the rest."""

    root: Path
    scenes: Sequence[str]
    styles: Sequence[str]

    def environment(self, **more: str) -> dict[str, str]:
        """That of its commands."""
        own = {f"STYLETRF_{n.upper()}": str(self.root / n) for n in ("data", "store", "out")}
        return os.environ | own | {"PYTHONPATH": str(ROOT)} | more

    def begin(self, *words: str, **more: str) -> "subprocess.Popen[str]":
        """The grid's command, under way."""
        grid = ["Grid", "--scenes", json.dumps(self.scenes), "--styles", json.dumps(self.styles)]
        options = ["--quality", "draft", "--content", "embedded", "--tuning", json.dumps(TUNING)]
        return subprocess.Popen(
            [sys.executable, "-m", "luigi", "--module", "tasks", *grid, *options, *words],
            cwd=ROOT,
            env=self.environment(**more),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def store(self) -> Store:
        """What it made."""
        return Store.open(self.root / "store")

    def forget(self) -> None:
        """Remove all that it made."""
        for name in ("store", "out"):
            shutil.rmtree(self.root / name, ignore_errors=True)


def prepare(root: Path, n_scenes: int, n_styles: int) -> GridRun:
    """Returns a grid on courtyards that differ in their number of views."""
    names = [f"yard{k}" for k in range(n_scenes)]
    for k, name in enumerate(names):
        config = CourtyardConfig(n_views=12 + k, width=200, height=150)
        write_courtyard(root / "data/scenes" / name, config)
    (root / "data/styles").mkdir(parents=True, exist_ok=True)
    for style in STYLES[:n_styles]:
        shutil.copy(ROOT / "data/styles" / f"{style}.jpg", root / "data/styles")
    return GridRun(root, names, STYLES[:n_styles])


def digests(grid: GridRun) -> dict[str, str]:
    """What each result is made of, by its label; without the reports, which tell what it took."""
    store = grid.store()
    found = {str(r.provenance["label"]): r.output.digest for r in store.records()}
    return {label: d for label, d in found.items() if "StylizedTrajectory" not in label}


def compare_workers(grid: GridRun, workers: int) -> None:
    """Times the same grid with one worker and with several, and compares what they made.

    A first run, by one worker with as many cores as each of several has, compiles the kernels; its
    results have to be the same to the last bit (torch adds up in another order with other threads).
    """
    cores = len(os.sched_getaffinity(0)) // workers
    seconds, made = {}, {}
    for name, words, place in (
        ("a share of the cores", 1, {"STYLETRF_CORES": str(cores)}),
        ("one", 1, {}),
        ("several", workers, {}),
    ):
        grid.forget()
        begun = time.monotonic()
        command = grid.begin("--workers", str(words), **place)
        screen, _ = command.communicate()
        if command.returncode:
            raise SystemExit(screen)
        seconds[name], made[name] = time.monotonic() - begun, digests(grid)
        print(f"{name}: {seconds[name]:.0f} s, {len(made[name])} artifacts", flush=True)  # noqa: T201
    several, alone = made["several"], made["a share of the cores"]
    other = sorted(label for label in several if several[label] != alone.get(label))
    print(f"{workers} workers: {seconds['one'] / seconds['several']:.2f} times as much")  # noqa: T201
    print(f"{len(several) - len(other)} of {len(several)} digests alike; others: {other}")  # noqa: T201


def soak(grid: GridRun, minutes: float, seed: int) -> None:
    """Makes the grid again and again under random kills, and looks for what was lost."""
    chance, end, rounds = random.Random(seed), time.monotonic() + 60 * minutes, 0
    while time.monotonic() < end:
        rounds += 1
        grid.forget()
        kills = _one_round(grid, chance)
        _require_sound(grid)
        print(f"round {rounds}: whole after {dict(kills)}", flush=True)  # noqa: T201


def _one_round(grid: GridRun, chance: random.Random) -> Counter[str]:
    """Two commands under a luigid, killed and begun again until one has nothing left to do."""
    luigid = Luigid(grid.root, retries=50)
    commands: list[subprocess.Popen[str]] = []
    kills, most = Counter[str](), chance.randint(3, 12)
    try:
        while True:
            commands = [c for c in commands if c.poll() is None]
            while len(commands) < 2:
                workers = str(chance.randint(1, 2))
                config = str(luigid.config)
                commands.append(grid.begin("--workers", workers, LUIGI_CONFIG_PATH=config))
            time.sleep(chance.uniform(1, 8))
            if kills.total() < most:
                kills[_kill_one(commands, luigid, chance)] += 1
            elif any(command.poll() == 0 for command in commands):
                return kills
    finally:
        for command in commands:
            command.kill()
            command.communicate()
        luigid.kill()


def _kill_one(
    commands: Sequence["subprocess.Popen[str]"], luigid: Luigid, chance: random.Random
) -> str:
    command = chance.choice(commands)
    what = chance.choice(["command", "build", "luigid", "Ctrl-C"])
    if what == "luigid":
        luigid.kill()
        time.sleep(chance.uniform(0, 3))
        luigid.start()
    elif what == "command":
        command.kill()
    elif what == "Ctrl-C":
        command.send_signal(signal.SIGINT)
    else:
        below = (
            psutil.Process(command.pid).children(recursive=True) if command.poll() is None else []
        )
        if not below:
            return "nothing"
        chance.choice(below).kill()
    return what


def _require_sound(grid: GridRun) -> None:
    """Ends the soak at the first thing that is not as it should be."""
    store, cells = grid.store(), len(grid.scenes) * len(grid.styles)
    shown = list((grid.root / "out").glob("*/*/report.html"))
    finished = Counter(a.log.name[:16] for a in attempts(store) if a.is_published)
    twice = [key for key, times in finished.items() if times > 1]
    broken = list(problems(store, deep=True))
    left = [p for p in (store.root / "tmp").iterdir() if is_held(p)]
    if len(shown) != cells or broken or twice or left or not all(p.exists() for p in shown):
        raise SystemExit(f"{len(shown)} of {cells} shown; {broken=} {twice=} {left=}")


def main() -> None:
    """Times, or soaks."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=3)
    parser.add_argument("--styles", type=int, default=4)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--soak-minutes", type=float, default=0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        grid = prepare(Path(folder), options.scenes, options.styles)
        if options.soak_minutes:
            soak(grid, options.soak_minutes, options.seed)
        else:
            compare_workers(grid, options.workers)


if __name__ == "__main__":
    main()
