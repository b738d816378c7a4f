"""Fixtures of the tests of presets."""

import pytest

from tasks.machine.calibration import calibration_of_machine


@pytest.fixture
def mini_data(monkeypatch, photographs, tmp_path):
    """The photographs of the mini scene, and no calibration of another test."""
    monkeypatch.setenv("STYLETRF_DATA", str(photographs))
    monkeypatch.setenv("STYLETRF_OUT", str(tmp_path / "out"))
    calibration_of_machine.cache_clear()
