"""Threads for the cores that other work leaves free."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import numba
import pytest
import torch

from styletrf import free_cores
from styletrf.free_cores import CoreTimes, FreeCoreThreads, core_times

CORES = sorted(os.sched_getaffinity(0))
needs_two_cores = pytest.mark.skipif(len(CORES) < 2, reason="a process has a thread at least")


@pytest.fixture
def threads(all_cores) -> Iterator[Callable[[], set[int]]]:
    """Returns how many threads the libraries use; all cores at first."""
    yield lambda: {torch.get_num_threads(), numba.get_num_threads()}
    torch.set_num_threads(len(CORES))
    numba.set_num_threads(min(len(CORES), numba.config.NUMBA_NUM_THREADS))


@pytest.mark.parametrize(
    ("idle_s", "own_s", "free"),
    [(2.0, 0.0, 1.0), (0.0, 2.0, 1.0), (0.0, 4.0, 2.0), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)],
    ids=["idle", "own on one", "own on both", "half of each", "others on both"],
)
def test_a_core_is_free_while_it_is_idle_or_computes_for_this_process(idle_s, own_s, free):
    before = CoreTimes(100.0, 50.0, 10.0)
    after = CoreTimes(102.0, 50.0 + idle_s, 10.0 + own_s)
    assert after.free_cores_since(before) == free


def test_a_process_that_computes_has_no_more_time_than_its_cores():
    before = core_times()
    while (now := core_times()).clock_s < before.clock_s + 0.3:
        pass
    elapsed_s, own_s = now.clock_s - before.clock_s, now.own_s - before.own_s
    assert own_s > 0
    ticks_s = 0.02 * len(CORES)
    assert own_s + now.idle_s - before.idle_s <= elapsed_s * len(CORES) + ticks_s


@needs_two_cores
def test_threads_are_as_many_as_the_free_cores_and_come_back(monkeypatch, threads):
    n = len(CORES)
    free = [n - 1.0, 0.1, n - 0.4, n + 3.0]
    monkeypatch.setattr(free_cores, "core_times", lambda: CoreTimes(0.0, 0.0, 0.0))
    monkeypatch.setattr(CoreTimes, "free_cores_since", lambda *_: free.pop(0))
    adjusted = FreeCoreThreads()
    seen = []
    while free:
        adjusted.adjust()
        seen += threads()
    assert seen == [n - 1, 1, n, n]


def test_more_threads_than_the_caller_allowed_are_never_used(monkeypatch, threads):
    torch.set_num_threads(1)
    numba.set_num_threads(1)
    monkeypatch.setattr(free_cores, "core_times", lambda: CoreTimes(0.0, 0.0, 0.0))
    monkeypatch.setattr(CoreTimes, "free_cores_since", lambda *_: 64.0)
    FreeCoreThreads().adjust()
    assert threads() == {1}


def test_cores_are_looked_at_once_a_period(monkeypatch, threads):
    adjusted = FreeCoreThreads(period_s=60.0)
    monkeypatch.setattr(free_cores, "core_times", lambda: pytest.fail("it looked"))
    adjusted.adjust()
    assert threads() == {len(CORES)}


@needs_two_cores
@pytest.mark.slow
def test_a_busy_process_takes_a_thread(threads):
    on_core = f"import os; os.sched_setaffinity(0, [{CORES[-1]}]); print(flush=True)"
    code = f"{on_core}\nwhile True: pass"
    with subprocess.Popen([sys.executable, "-S", "-c", code], stdout=subprocess.PIPE) as busy:
        try:
            assert busy.stdout.readline()
            adjusted = FreeCoreThreads(period_s=0.3)
            time.sleep(0.3)
            adjusted.adjust()
        finally:
            busy.kill()
    assert max(threads()) < len(CORES)
