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

kernels, factors = kernels_for(torch.device("cpu")), TensorVM((64, 64, 64), (16, 16, 16))
positions, matrix = 2 * torch.rand(4096, 3) - 1, torch.rand(48, 64)

def work():  # by the threads of numba and of torch in turns
    (kernels.features(factors, positions) @ matrix).relu().mean().backward()

def rate(threads, seconds=1.2):
    numba.set_num_threads(threads), torch.set_num_threads(threads)
    work()
    done, begun = 0, time.monotonic()
    while time.monotonic() < begun + seconds:
        work()
        done += 1
    return done / (time.monotonic() - begun)

forever = "import time; end = time.monotonic() + 30\\nwhile time.monotonic() < end: pass"
busy = subprocess.Popen([sys.executable, "-S", "-c", forever])
try:
    print(rate(1), rate({len(CORES)}))
finally:
    busy.kill()
"""


@pytest.mark.slow
@pytest.mark.skipif(len(CORES) < 2, reason="on one core, threads of a build wait for no other")
def test_two_threads_of_a_build_beside_a_busy_one_do_a_quarter_of_what_one_does(monkeypatch):
    """Threads of libgomp that spin for long did a tenth and less: see `openmp_wait_settings`.

    One thread waits for no other, so the law holds whatever else the machine does.
    """
    for name in (SPIN_COUNT, "OMP_WAIT_POLICY", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    words = [sys.executable, "-c", RATES]
    printed = subprocess.check_output(words, env=build_environment(), text=True, timeout=60)
    one, two = map(float, printed.split())
    assert two >= 0.25 * one
