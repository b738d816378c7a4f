"""Builds on a machine that does other work: their threads do not wait for each other in vain."""

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
import numba, torch
from styletrf.field.kernels import kernels_for
from styletrf.field.tensor_vm import TensorVM
from styletrf.free_cores import FreeCoreThreads

kernels, factors = kernels_for(torch.device("cpu")), TensorVM((64, 64, 64), (16, 16, 16))
positions, matrix = 2 * torch.rand(4096, 3) - 1, torch.rand(48, 64)

def work():  # by the threads of numba and of torch in turns
    (kernels.features(factors, positions) @ matrix).relu().mean().backward()

def rate(threads, adjust, seconds=2.0):
    numba.set_num_threads(threads), torch.set_num_threads(threads)
    work()
    done, begun = 0, time.monotonic()
    while time.monotonic() < begun + seconds:
        work()
        adjust()
        done += 1
    return done / (time.monotonic() - begun)

forever = "import time; end = time.monotonic() + 30\\nwhile time.monotonic() < end: pass"
busy = subprocess.Popen([sys.executable, "-S", "-c", forever])
try:
    print(rate(1, lambda: None), rate({len(CORES)}, FreeCoreThreads(0.2).adjust))
finally:
    busy.kill()
"""


@pytest.mark.slow
@pytest.mark.skipif(len(CORES) < 2, reason="on one core, threads of a build wait for no other")
def test_a_build_beside_a_busy_thread_does_half_of_what_one_thread_does(monkeypatch):
    """Threads of libgomp that spin for long did a tenth and less, since they never were fewer.

    One thread waits for no other, so the law holds whatever else the machine does.
    """
    for name in (SPIN_COUNT, "OMP_WAIT_POLICY", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    words = [sys.executable, "-c", RATES]
    printed = subprocess.check_output(words, env=build_environment(), text=True, timeout=60)
    one, adjusted = map(float, printed.split())
    assert adjusted >= 0.5 * one
