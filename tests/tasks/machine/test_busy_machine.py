"""Builds on a machine that does other work: none gets far less than its fair part of the cores."""

import os
import subprocess
import sys

import pytest

from pipeline.execution.environment import SPIN_COUNT, build_environment

CORES = sorted(os.sched_getaffinity(0))[:2]
"""A busy thread on one of many cores would matter less."""
RATES = f"""
import os, subprocess, sys, time
os.sched_setaffinity(0, {CORES})
import torch
from styletrf.field.kernels import kernels_for
from styletrf.field.tensor_vm import TensorVM

kernels, factors = kernels_for(torch.device("cpu")), TensorVM((64, 64, 64), (16, 16, 16))
positions, matrix = 2 * torch.rand(4096, 3) - 1, torch.rand(48, 64)

def work():  # by the threads of numba and of torch in turns
    (kernels.features(factors, positions) @ matrix).relu().mean().backward()

def rate(seconds=1.2):
    done, begun = 0, time.monotonic()
    while time.monotonic() < begun + seconds:
        work()
        done += 1
    return done / (time.monotonic() - begun)

work()
alone = rate()
forever = "import time; end = time.monotonic() + 30\\nwhile time.monotonic() < end: pass"
busy = subprocess.Popen([sys.executable, "-S", "-c", forever])
try:
    print(alone, rate())
finally:
    busy.kill()
"""


@pytest.mark.slow
@pytest.mark.skipif(len(CORES) < 2, reason="on one core, threads of a build wait for no other")
def test_build_beside_a_busy_thread_keeps_a_tenth_of_its_fair_part(monkeypatch):
    """Threads of libgomp that spin for long kept a hundredth: see `openmp_wait_settings`."""
    for name in (SPIN_COUNT, "OMP_WAIT_POLICY", "OMP_NUM_THREADS"):  # of the tests, or of the user
        monkeypatch.delenv(name, raising=False)
    words = [sys.executable, "-c", RATES]
    printed = subprocess.check_output(words, env=build_environment(), text=True, timeout=60)
    alone, beside = map(float, printed.split())
    fair = (len(CORES) - 0.5) / len(CORES)
    assert beside >= 0.1 * fair * alone
