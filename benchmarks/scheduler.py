"""What Luigi's scheduler takes for grids of many cells: `python benchmarks/scheduler.py --help`.

    scheduler.py --cells 100 300 1000 3000 10000            one grid, all workers at it
    scheduler.py --cells 10000 --partition 100              the same cells, a grid of 100 at a time

The scheduler is Luigi's own, called as its server calls it; what is synthetic is the workers, the
clock and how long tasks take. A row of Markdown a grid: calls and milliseconds for registering,
asking for work and reporting, the scheduler's time for each task, its memory, and how busy the
workers were.
"""

import argparse
import heapq
import random
import time
from dataclasses import dataclass, field

import psutil
from luigi.scheduler import Scheduler, scheduler

SCENE = {  # seconds of the stages of a scene at draft, and what each waits for
    "SceneCapture": (3, ()),
    "CameraPoses": (23, ("SceneCapture",)),
    "SceneModel": (4, ("CameraPoses",)),
    "RadianceField": (134, ("CameraPoses", "SceneModel")),
    "TrajectoryFrames": (39, ("RadianceField",)),
    "QualityMetrics": (20, ("RadianceField",)),
    "PriorRenders": (13, ("TrajectoryFrames",)),
}
CELL = {  # of a scene in a style
    "StyleNetwork": (203, ("PriorRenders",)),
    "StylizedPriors": (6, ("StyleNetwork",)),
    "StylizedField": (32, ("StylizedPriors", "RadianceField")),
    "StylizedFrames": (35, ("StylizedField", "TrajectoryFrames")),
    "ConsistencyMetrics": (30, ("StylizedFrames",)),
    "StylizedTrajectory": (1, ("ConsistencyMetrics", "QualityMetrics")),
}


@dataclass(frozen=True, slots=True)
class Job:
    """A task: its name, what it waits for, and how long it takes."""

    name: str
    needs: tuple[str, ...]
    seconds: float


@dataclass
class Clerk:
    """Luigi's scheduler, and a clock on each kind of call."""

    scheduler: Scheduler = field(default_factory=lambda: Scheduler(scheduler(), resources=None))
    calls: dict[str, list[float]] = field(default_factory=dict)

    def call(self, kind: str, name: str, **words: object) -> object:
        """Calls a method, and notes how long that took."""
        started = time.perf_counter()
        answer = getattr(self.scheduler, name)(**words)
        self.calls.setdefault(kind, []).append(time.perf_counter() - started)
        return answer


def jobs(scenes: range, styles: range, seed: int) -> list[Job]:
    """Returns the tasks of a grid, each after what it waits for; durations are log-normal."""
    chance = random.Random(seed)  # noqa: S311  durations

    def named(stage: str, scene: int, style: int) -> str:
        return f"{stage}_{scene}_{style}" if stage in CELL else f"{stage}_{scene}"

    def job(stage: str, scene: int, style: int) -> Job:
        seconds, needs = (SCENE | CELL)[stage]
        there = tuple(named(need, scene, style) for need in needs)
        return Job(named(stage, scene, style), there, seconds * chance.lognormvariate(0, 0.3))

    found = []
    for scene in scenes:
        found += [job(stage, scene, 0) for stage in SCENE]
        found += [job(stage, scene, style) for style in styles for stage in CELL]
    return found


def simulate(
    clerk: Clerk, grid: list[Job], workers: int, most_done: int
) -> tuple[int, float, float]:
    """Runs a grid on workers that each register all of it, as every `luigi` command does.

    Returns:
        How many tasks were done, the simulated seconds that took, and those of all workers' work.
    """
    names = [f"worker{k}" for k in range(workers)]
    for worker in names:
        clerk.call("worker", "add_worker", worker=worker, info=[])
        for job in grid:
            told = {"task_id": job.name, "deps": list(job.needs), "params": {}}
            clerk.call("register", "add_task", worker=worker, **told)
    seconds = {job.name: job.seconds for job in grid}
    now, done, busy, running, idle = 0.0, 0, 0.0, [], list(names)
    while done < most_done:
        while idle and (task := clerk.call("ask", "get_work", worker=idle[-1])["task_id"]):
            busy += seconds[task]
            heapq.heappush(running, (now + seconds[task], task, idle.pop()))
        if not running:
            break
        now, task, worker = heapq.heappop(running)
        clerk.call("report", "add_task", worker=worker, task_id=task, status="DONE")
        idle.append(worker)
        done += 1
    return done, now, busy


def row(cells: int, partition: int, styles: int, workers: int, most_done: int) -> str:
    """Returns the row of a grid of so many cells."""
    process, clerk = psutil.Process(), Clerk()
    before, done, now, busy, tasks = process.memory_info().rss, 0, 0.0, 0.0, 0
    most = 0
    for first in range(0, cells, partition):
        clerk.scheduler = Scheduler(scheduler(), resources=None)  # what was done is forgotten
        scenes = range(first // styles, max(first // styles + 1, (first + partition) // styles))
        grid = jobs(scenes, range(min(styles, partition)), seed=first)
        tasks += len(grid)
        d, n, b = simulate(clerk, grid, workers, most_done - done)
        done, now, busy = done + d, now + n, busy + b
        most = max(most, process.memory_info().rss - before)
        if done >= most_done:
            break
    spent = {kind: (len(calls), sum(calls)) for kind, calls in clerk.calls.items()}
    each = {kind: 1000 * total / max(count, 1) for kind, (count, total) in spent.items()}
    total = each["register"] * workers + 1000 * (spent["ask"][1] + spent["report"][1]) / done
    return (
        f"| {cells} | {partition} | {tasks} | {each['register']:.3f} | {each['ask']:.2f}"
        f" | {each['report']:.3f} | {total:.1f} | {most / 2**20:.0f} | {busy / now / workers:.0%} |"
    )


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cells", type=int, nargs="+", required=True)
    parser.add_argument("--partition", type=int, default=0, help="cells of one grid; 0: all")
    parser.add_argument("--styles", type=int, default=100, help="a scene")
    parser.add_argument("--workers", type=int, default=50)
    parser.add_argument("--most-done", type=int, default=1 << 30, help="stop after so many tasks")
    options = parser.parse_args()
    heads = ("cells", "at a time", "tasks", "register, ms", "ask, ms", "report, ms")
    heads += ("scheduler a task, ms", "memory, MiB", "workers busy")
    print("| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|")  # noqa: T201
    for cells in options.cells:
        partition = options.partition or cells
        told = row(cells, partition, options.styles, options.workers, options.most_done)
        print(told, flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
