"""The progress bar, on a terminal and in a file."""

import contextlib
import io
import os
from typing import TextIO

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


def unread_pipe() -> TextIO:
    reading, writing = os.pipe()
    os.close(reading)
    return os.fdopen(writing, "w", buffering=1)


def closed_stream() -> TextIO:
    stream = io.StringIO()
    stream.close()
    return stream


def file_on_a_full_disk() -> TextIO:
    return os.fdopen(os.open("/dev/full", os.O_WRONLY), "w", buffering=1)


@pytest.mark.parametrize("opened", [unread_pipe, closed_stream, file_on_a_full_disk])
def test_a_stream_that_cannot_be_written_stops_no_build(clock, opened):
    """`2>&1 | tee log`, where tee has ended; a log on a full disk."""
    bar = ProgressBar("RadianceField", stream := opened(), interactive=False)
    for second in (20.0, 40.0):
        clock[0] = second
        bar(int(second), 60)
        bar.say("a line")
    bar.close()
    with contextlib.suppress(OSError):
        stream.close()
