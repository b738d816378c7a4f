"""What other work on the machine costs: `python benchmarks/busy_machine.py --seconds 20`.

Counts the iterations of a fit, of a style network and of an adaptation in so many seconds: alone,
beside one busy thread, and beside a second of its kind; with the environment as it is, with that of
builds (`GOMP_SPINCOUNT`), with builds' threads for free cores in addition (`styletrf.free_cores`),
and with OMP_WAIT_POLICY=PASSIVE. The fair share of a fit that could use all N cores, beside k busy
threads, is N / (N + k) of what it does alone.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import torch

from pipeline.execution.environment import openmp_wait_settings
from styletrf.evaluation.calibration.workloads import field_steps, network_steps
from styletrf.field.field_config import FieldConfig
from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField
from styletrf.free_cores import FreeCoreThreads
from styletrf.geometry.cameras import Camera
from styletrf.geometry.space import Space
from styletrf.stylization.adaptation import AdaptationConfig, adapt_appearance

CPU = torch.device("cpu")
BUSY = "while True: pass"
CHUNKS = {"field": 8, "network": 4}
"""Iterations of one call of the workloads."""
IMAGES = 2
"""Of a batch of the style network at `draft` and `standard`."""
SETTINGS: dict[str, tuple[dict[str, str], bool]] = {
    "as it is": ({}, False),
    "with the variables of builds": (openmp_wait_settings({}), False),
    "as builds": (openmp_wait_settings({}), True),
    "OMP_WAIT_POLICY=PASSIVE": ({"OMP_WAIT_POLICY": "PASSIVE"}, False),
}
"""Variables, and whether the threads are as many as the free cores."""


class OverError(Exception):
    """The time of a count is over."""


def count(kind: str, seconds: float, adjust: Callable[[], None]) -> int:
    """Returns the iterations of a workload in so many seconds, after a first that compiles."""
    if kind == "adaptation":
        return _count_adaptation(seconds, adjust)
    steps = field_steps(CPU) if kind == "field" else network_steps(CPU, IMAGES)
    steps()
    return CHUNKS[kind] * _calls(steps, seconds, adjust)


def _calls(steps: Callable[[], None], seconds: float, adjust: Callable[[], None]) -> int:
    calls, end = 0, time.monotonic() + seconds
    while time.monotonic() < end:
        steps()
        adjust()
        calls += 1
    return calls


def _count_adaptation(seconds: float, adjust: Callable[[], None]) -> int:
    """Counts from the first iteration on, when the rays have been marched."""
    side, begun, count = 400, 0.0, 0

    def progress(done: int, total: int, **quality: float) -> None:  # noqa: ARG001
        nonlocal begun, count
        adjust()
        begun, count = begun or time.monotonic(), done
        if time.monotonic() - begun > seconds:
            raise OverError

    pose = np.column_stack([np.eye(3), [0.0, 0.0, -3.0]])
    camera = Camera("0", side, side, 500.0, 500.0, side / 2, side / 2, pose)
    space = Space("box", np.eye(4)[None], (1.0, 1.0, 1.0), depth_min=0.1)
    config = FieldConfig(density_ranks=(16,), appearance_ranks=(24,), shading="plain")
    field = RadianceField(config.in_space("box"), (96, 96, 96), torch.Generator().manual_seed(0))
    field.step_length = 0.02
    images = torch.randint(256, (2, side, side, 3), dtype=torch.uint8)
    adaptation = AdaptationConfig(iterations=100_000, batch=16384)
    try:
        adapt_appearance(
            field, [camera, replace(camera, name="1")], images, space, adaptation,
            kernels_for(CPU), progress,
        )  # fmt: skip
    except OverError:
        return count
    raise RuntimeError("the adaptation ended before its time")


def counts(command: Sequence[str], environment: Mapping[str, str]) -> dict[str, list[int]]:
    """Returns the iterations alone, beside a busy thread, and of two beside each other."""
    busy = subprocess.Popen([sys.executable, "-c", BUSY])
    try:
        beside = _counted(command, environment, 1)
    finally:
        busy.kill()
        busy.wait()
    return {
        "alone": _counted(command, environment, 1),
        "beside a busy thread": beside,
        "two at once": _counted(command, environment, 2),
    }


def _counted(command: Sequence[str], environment: Mapping[str, str], copies: int) -> list[int]:
    unset = {k: v for k, v in os.environ.items() if k not in ("GOMP_SPINCOUNT", "OMP_WAIT_POLICY")}
    running = [
        subprocess.Popen(command, env={**unset, **environment}, stdout=subprocess.PIPE, text=True)
        for _ in range(copies)
    ]
    return [int(json.loads(each.communicate()[0])) for each in running]


def main() -> None:
    """Counts one workload, or prints the table of all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--count", choices=["field", "network", "adaptation"])
    parser.add_argument("--adjust", action="store_true", help="have threads for free cores only")
    options = parser.parse_args()
    if options.count:
        adjust = FreeCoreThreads().adjust if options.adjust else lambda: None
        sys.stdout.write(f"{count(options.count, options.seconds, adjust)}\n")
        return
    for kind in ("field", "network", "adaptation"):
        for name, (environment, adjusts) in SETTINGS.items():
            command = [sys.executable, __file__, "--count", kind, f"--seconds={options.seconds}"]
            found = counts([*command, *["--adjust"] * adjusts], environment)
            cells = (" and ".join(map(str, numbers)) for numbers in found.values())
            sys.stdout.write(f"| {kind} | {name} | {' | '.join(cells)} |\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
