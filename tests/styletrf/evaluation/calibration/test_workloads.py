"""The reference workloads that calibrate a machine."""

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


def test_the_fastest_run_counts_and_the_first_does_not():
    pauses = iter([0.2, 0.0, 0.05, 0.0])
    assert fastest_of(lambda: time.sleep(next(pauses)), repeats=3) < 0.05
