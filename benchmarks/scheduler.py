"""What Luigi's scheduler takes for grids of many cells: `python benchmarks/scheduler.py --help`.

    scheduler.py --cells 100 300 1000 3000 10000            one grid, all workers at it
    scheduler.py --cells 10000 --partition 100 --crews 10   the same cells, a grid of 100 at a time;
                                                            ten luigids, a tenth of the workers each

The scheduler is Luigi's own, called as its server calls it; what is synthetic is the workers, the
clock and how long tasks take. A row of Markdown a grid: calls and milliseconds for registering,
asking for work and reporting, the scheduler's CPU time for each task, its memory, and how busy the
workers were.
"""

import argparse
import heapq
import itertools
import random
import time
from dataclasses import dataclass, field
from typing import Any

import psutil
from luigi.scheduler import Scheduler, scheduler
from luigi.task import flatten
from task_of import task_of

from pipeline.maintenance.task_graph import upstream_first
from tasks import Grid

SECONDS = {  # of the stages at draft on two cores, see the README beside this
    "CameraPoses": 25,
    "RadianceField": 150,
    "TrajectoryFrames": 35,
    "QualityMetrics": 20,
    "PriorRenders": 13,
    "StyleNetwork": 200,
    "StylizedPriors": 6,
    "StylizedField": 35,
    "StylizedFrames": 40,
    "ConsistencyMetrics": 45,
}
OTHERS_S = 3


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

    def call(self, kind: str, name: str, **words: object) -> Any:
        """Calls a method, and notes how long that took."""
        started = time.process_time()
        answer = getattr(self.scheduler, name)(**words)
        self.calls.setdefault(kind, []).append(time.process_time() - started)
        return answer


def shape() -> list[tuple[str, tuple[str, ...], set[str]]]:
    """Returns the stages of a cell as the tasks tell them: what each waits for, and is made of."""
    (cell,) = task_of(
        Grid, scenes=["s"], styles=["p"], quality="draft", content="embedded"
    ).requires()
    return [
        (
            task.task_family,
            tuple(need.task_family for need in flatten(task.requires())),
            {name for name in ("scene", "style") if getattr(task, name, "")},
        )
        for task in upstream_first(cell)
    ]


def jobs(scenes: range, styles: range, seed: int) -> list[Job]:
    """Returns the tasks of a grid; durations are log-normal."""
    chance, stages = random.Random(seed), shape()  # noqa: S311  durations
    made_of = {family: parts for family, _, parts in stages}

    def named(family: str, scene: int, style: int) -> str:
        numbers = {"scene": scene, "style": style}
        return "_".join([family, *(f"{part}{numbers[part]}" for part in sorted(made_of[family]))])

    found: dict[str, Job] = {}
    for scene, style in itertools.product(scenes, styles):
        for family, needs, _ in stages:
            name = named(family, scene, style)
            if name not in found:
                there = tuple(named(need, scene, style) for need in needs)
                seconds = SECONDS.get(family, OTHERS_S) * chance.lognormvariate(0, 0.3)
                found[name] = Job(name, there, seconds)
    return list(found.values())


@dataclass
class Crew:
    """Workers with a clock, that run one grid after the other."""

    names: list[str]
    clerk: Clerk = field(default_factory=Clerk)
    made: set[str] = field(default_factory=set)  # by all crews, in a store that they share
    now_s: float = 0.0
    busy_s: float = 0.0

    def register(self, grid: list[Job]) -> None:
        """Each worker tells all of the grid, as every `luigi` command does, and what is there."""
        for worker in self.names:
            self.clerk.call("worker", "add_worker", worker=worker, info=[])
            for job in grid:
                status = "DONE" if job.name in self.made else "PENDING"
                request = {"task_id": job.name, "deps": list(job.needs), "params": {}}
                self.clerk.call("register", "add_task", worker=worker, status=status, **request)

    def run(self, grid: list[Job], most: int) -> int:
        """Runs a registered grid until it or so many tasks are done, and returns how many were."""
        seconds = {job.name: job.seconds for job in grid}
        running: list[tuple[float, str, str]] = []
        idle, done = list(self.names), 0
        while done < most:
            while idle and (name := self._ask(idle[-1])):
                self.busy_s += seconds[name]
                heapq.heappush(running, (self.now_s + seconds[name], name, idle.pop()))
            if not running:
                break
            self.now_s, name, worker = heapq.heappop(running)
            self.clerk.call("report", "add_task", worker=worker, task_id=name, status="DONE")
            self.made.add(name)
            idle.append(worker)
            done += 1
        return done

    def _ask(self, worker: str) -> str | None:
        return self.clerk.call("ask", "get_work", worker=worker)["task_id"]


def row(cells: int, partition: int, styles: int, crews: list[Crew], most_done: int) -> str:
    """Returns the row of a grid of so many cells, scheduled so many at a time by each crew."""
    process = psutil.Process()
    before, most, done, tasks = process.memory_info().rss, 0, 0, 0
    for first in range(0, cells, partition):
        crew = min(crews, key=lambda crew: crew.now_s)
        crew.clerk.scheduler = Scheduler(scheduler(), resources=None)  # what was done is forgotten
        scenes = range(first // styles, max(first // styles + 1, (first + partition) // styles))
        grid = jobs(scenes, range(min(styles, partition)), seed=first)
        tasks += sum(job.name not in crew.made for job in grid)
        crew.register(grid)
        done += crew.run(grid, most_done - done)
        most = max(most, process.memory_info().rss - before)
        if done >= most_done:
            break
    return f"| {cells} | {partition} | {tasks} | {_figures(crews, done)} | {most / 2**20:.0f} |"


def _figures(crews: list[Crew], done: int) -> str:
    spent: dict[str, list[float]] = {}
    for crew in crews:
        for kind, calls in crew.clerk.calls.items():
            spent.setdefault(kind, []).extend(calls)
    each = {kind: 1000 * sum(calls) / len(calls) for kind, calls in spent.items()}
    total = 1000 * sum(sum(calls) for calls in spent.values()) / done
    workers = sum(len(crew.names) for crew in crews)
    ended_s = max(crew.now_s for crew in crews)
    busy = sum(crew.busy_s for crew in crews) / ended_s / workers
    return (
        f"{each['register']:.3f} | {each['ask']:.2f} | {each['report']:.3f} | {total:.1f}"
        f" | {ended_s / 3600:.1f} | {busy:.0%}"
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
    parser.add_argument("--crews", type=int, default=1, help="luigids, each with a part of them")
    parser.add_argument("--most-done", type=int, default=1 << 30, help="stop after so many tasks")
    options = parser.parse_args()
    heads = [
        "cells", "at a time", "tasks", "register, ms", "ask, ms", "report, ms",
        "scheduler a task, ms", "hours", "workers busy", "memory, MiB",
    ]  # fmt: skip
    print("| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|")  # noqa: T201
    for cells in options.cells:
        partition = options.partition or cells
        made, each = set[str](), options.workers // options.crews
        crews = [Crew([f"{c}.{k}" for k in range(each)], made=made) for c in range(options.crews)]
        timed = row(cells, partition, options.styles, crews, options.most_done)
        print(timed, flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
