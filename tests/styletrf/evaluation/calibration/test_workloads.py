"""The reference workloads that calibrate a machine."""

import os
import time
from functools import partial

import pytest
import torch

from styletrf.evaluation.calibration import workloads
from styletrf.evaluation.calibration.workloads import fastest_of, measure_workloads


def test_every_kind_of_stage_has_a_workload_that_takes_time(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(workloads, "fastest_of", partial(fastest_of, repeats=1))
    seconds = measure_workloads(torch.device("cpu"))
    assert seconds.keys() == {"poses", "field", "network"}
    assert all(0 < each < 60 for each in seconds.values())


def burn(seconds: float) -> None:
    end_s = time.process_time() + seconds
    while time.process_time() < end_s:
        pass


def test_the_first_run_is_not_counted_and_the_fastest_of_the_others_is():
    """Of a run beside other work its CPU time on all cores remains, at the least."""
    seconds = iter([0.0, 0.2, 0.05, 0.2])
    fastest_s = fastest_of(lambda: burn(next(seconds)), repeats=3)
    assert 0.05 / (os.cpu_count() or 1) <= fastest_s < 0.1
