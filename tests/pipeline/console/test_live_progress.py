"""A live line for each of several builds, on a real terminal."""

import contextlib
import fcntl
import json
import os
import pty
import struct
import subprocess
import sys
import termios
from collections.abc import Callable

from commands import ROOT, start

from pipeline.console.progress_client import ProgressClient, ProgressLine
from pipeline.execution.progress_pipe import ProgressPipe, read_messages


def read_until_closed(process: subprocess.Popen, terminal: int) -> str:
    """All that a process writes to a terminal."""
    text = bytearray()
    with contextlib.suppress(OSError):  # a closed terminal raises it
        while part := os.read(terminal, 1 << 16):
            text += part
    process.communicate(timeout=60)
    return text.decode()


def open_terminal() -> tuple[int, int]:
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
    return ours, theirs


def rendered(*messages: bytes) -> str:
    """What the renderer draws of messages."""
    ours, theirs = open_terminal()
    process = subprocess.Popen(
        [sys.executable, "-m", "pipeline.console.progress_renderer"],
        stdin=subprocess.PIPE,
        stderr=theirs,
        cwd=ROOT,
        env=os.environ | {"TERM": "xterm"},
    )
    os.close(theirs)
    process.stdin.write(b"".join(messages))
    process.stdin.close()
    process.stdin = None
    text = read_until_closed(process, ours)
    os.close(ours)
    assert process.returncode == 0, text
    return text


def message(**fields: object) -> bytes:
    return json.dumps(fields).encode() + b"\n"


def test_each_build_has_a_live_line_and_log_lines_stay_above():
    text = rendered(
        message(expected_s=100.0),
        message(label="RadianceField horns", done=50, total=200, quality="psnr 21.5"),
        message(label="StyleNetwork udnie", done=10, total=100, quality="loss 4"),
        message(line="StyleImage: done in 3 s [not markup]"),
        message(removed="RadianceField horns", expected_s=25.0),
        message(close=True),
    )
    for part in ("RadianceField horns", "25%", "psnr 21.5", "StyleNetwork udnie", "10%", "loss 4"):
        assert part in text
    assert "StyleImage: done in 3 s [not markup]" in text
    last = text.rpartition("StyleImage")[2]
    assert "all" in last


def sent(act: Callable[[ProgressClient], object]) -> list[bytes]:
    """The messages that a client sends."""
    reading, writing = os.pipe()
    act(ProgressClient(writing))
    os.close(writing)
    with os.fdopen(reading, "rb") as messages:
        return list(messages)


def test_the_renderer_draws_the_messages_of_the_client():
    def act(client: ProgressClient) -> None:
        client.start_total(100.0)
        ProgressLine("StyleNetwork udnie", client)(10, 100, loss=4.0)
        ProgressLine("RadianceField horns", client)(50, 200, psnr=21.5)
        client.remove("StyleNetwork udnie", 40.0)
        client.write("StyleImage: done in 3 s")

    text = rendered(*sent(act))
    for part in ("RadianceField horns", "psnr 21.5", "StyleImage: done in 3 s", "all", "40%"):
        assert part in text
    assert "StyleNetwork" not in text.rpartition("40%")[2], "its line is removed"


def test_a_long_line_is_sent_in_parts_that_a_pipe_keeps_whole():
    messages = sent(lambda client: client.write("\u20ac" * 1000 + "\nnext"))
    assert max(map(len, messages)) <= 4096
    parts = [json.loads(message) for message in messages]
    text = "".join(part["line"] + "\n" * (not part["continues"]) for part in parts)
    assert text == "\u20ac" * 1000 + "\nnext\n"


def test_the_renderer_skips_half_a_message():
    text = rendered(b'{"label": "Radi\n', b"\n", message(line="whole"))
    assert "whole" in text


def test_several_workers_share_a_terminal():
    ours, theirs = open_terminal()
    arguments = ["ManyOnCores", "--names", '["one", "two"]', "--workers", "2"]
    process = start("luigi", "--module", "toys", *arguments, stderr=theirs)
    os.close(theirs)
    text = read_until_closed(process, ours)
    os.close(ours)
    assert process.returncode == 0, text
    for name in ("one", "two"):
        assert f"OnCores {name}: started" in text
        assert f"OnCores {name}: done in" in text
    assert "Traceback" not in text


def test_records_logged_after_the_display_has_closed_are_shown():
    """The summary of a grid is one."""
    ours, theirs = open_terminal()
    code = """
import logging
from pipeline.console import progress_client
progress_client.workers_of_command = lambda: 2
from pipeline.console.log_handler import ConsoleHandler
logging.getLogger("pipeline").addHandler(ConsoleHandler())
logging.getLogger("pipeline").setLevel("INFO")
progress_client.progress_client().write("started")
progress_client.close_progress()
logging.getLogger("pipeline").info("4 cells: 4 made")
"""
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        stderr=theirs, cwd=ROOT, env=os.environ | {"TERM": "xterm"},
    )  # fmt: skip
    os.close(theirs)
    text = read_until_closed(process, ours)
    os.close(ours)
    assert text.index("started") < text.index("4 cells: 4 made")


def test_a_build_survives_the_end_of_the_renderer():
    reading, writing = os.pipe()
    os.close(reading)
    assert not ProgressClient(writing).write("a line")
    line = ProgressLine("RadianceField", ProgressClient(writing))
    line(1, 2, psnr=20.0)
    line.say("something")
    line.close()
    os.close(writing)


class RecordingDisplay:
    """A display that records its calls."""

    def __init__(self):
        self.calls = []

    def __call__(self, done, total, **quality):
        self.calls.append((done, total, quality))

    def say(self, line):
        self.calls.append(line)

    def close(self):
        self.calls.append("closed")


def test_the_pipe_carries_progress_lines_and_results():
    reading, writing = os.pipe()
    channel = ProgressPipe(writing)
    channel(1, 10, loss=float("nan"))
    channel.say("careful: \u20ac")
    os.write(writing, b'{"kind": "bui')
    os.write(writing, b'\n{"kind": "built", "seconds": 1.5}\n')
    os.close(writing)
    display = RecordingDisplay()
    with os.fdopen(reading, "rb") as lines:
        assert read_messages(lines, display) == {"kind": "built", "seconds": 1.5}
    (done, total, quality), line = display.calls
    assert (done, total, line) == (1, 10, "careful: \u20ac")
    assert list(quality) == ["loss"]


def test_progress_is_sent_five_times_a_second_and_at_each_new_phase():
    reading, writing = os.pipe()
    channel = ProgressPipe(writing)
    for k in range(1000):
        channel(k, 1000)
    channel(0, 7)
    os.close(writing)
    display = RecordingDisplay()
    with os.fdopen(reading, "rb") as lines:
        read_messages(lines, display)
    assert display.calls[0][:2] == (0, 1000)
    assert display.calls[-1][:2] == (0, 7)
    assert len(display.calls) < 20
