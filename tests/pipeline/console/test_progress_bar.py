"""The progress bar, on a terminal and in a file."""

import io

import pytest

from pipeline.console import progress
from pipeline.console.progress import ProgressBar


def test_a_terminal_shows_a_bar_until_it_is_closed():
    screen = io.StringIO()
    bar = ProgressBar("RadianceField horns", screen, interactive=True)
    for step in range(0, 101, 50):
        bar(step, 100, psnr=20 + step / 50)
    bar.close()
    text = screen.getvalue()
    assert "RadianceField horns" in text
    assert text.endswith("\r")
    assert text.rstrip("\r").rpartition("\r")[2].strip() == ""


@pytest.fixture
def clock(monkeypatch):
    """Seconds that pass only when the test says so."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(progress.tqdm, "_time", lambda _self: now[0], raising=False)
    return now


def test_a_file_gets_a_line_every_15_seconds(clock):
    screen = io.StringIO()
    bar = ProgressBar("RadianceField horns", screen, interactive=False)
    for second in range(40):
        clock[0] = float(second)
        bar(second, 40, psnr=21.25)
    bar.close()
    lines = screen.getvalue().splitlines()
    assert [line.split("/")[0].split()[-1] for line in lines] == ["15", "30"]
    assert all(line.startswith("RadianceField horns: ") and "psnr=21.25" in line for line in lines)
    assert "\r" not in screen.getvalue()


def test_a_further_phase_starts_a_new_bar(clock):
    screen = io.StringIO()
    bar = ProgressBar("Poses", screen, interactive=False)
    bar(10, 10)
    clock[0] = 20.0
    bar(1, 500)
    bar.close()
    assert "1/500" in screen.getvalue()


def test_a_bar_without_progress_draws_nothing():
    screen = io.StringIO()
    ProgressBar("Poses", screen, interactive=True).close()
    assert screen.getvalue() == ""
