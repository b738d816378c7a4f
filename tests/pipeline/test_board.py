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

from test_command import ROOT, start

from pipeline.board import Board, BoardLine
from pipeline.channel import Channel, follow


def screen_of(process: subprocess.Popen, terminal: int) -> str:
    """All that a process writes to a terminal."""
    said = bytearray()
    with contextlib.suppress(OSError):  # how a terminal says that it was closed
        while part := os.read(terminal, 1 << 16):
            said += part
    process.communicate(timeout=60)
    return said.decode()


def terminal() -> tuple[int, int]:
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
    return ours, theirs


def drawn(*messages: bytes) -> str:
    ours, theirs = terminal()
    process = subprocess.Popen(
        [sys.executable, "-m", "pipeline.board"],
        stdin=subprocess.PIPE,
        stderr=theirs,
        cwd=ROOT,
        env=os.environ | {"TERM": "xterm"},
    )
    os.close(theirs)
    process.stdin.write(b"".join(messages))
    process.stdin.close()
    process.stdin = None
    said = screen_of(process, ours)
    os.close(ours)
    assert process.returncode == 0, said
    return said


def message(**fields: object) -> bytes:
    return json.dumps(fields).encode() + b"\n"


def test_each_build_has_a_line_and_what_is_said_stays_above():
    said = drawn(
        message(expected=100.0),
        message(label="RadianceField horns", done=50, total=200, quality="psnr 21.5"),
        message(label="StyleNetwork udnie", done=10, total=100, quality="loss 4"),
        message(line="StyleImage: done in 3 s [not markup]"),
        message(gone="RadianceField horns", seconds=25.0),
        message(end=True),
    )
    for words in ("RadianceField horns", "25%", "psnr 21.5", "StyleNetwork udnie", "10%", "loss 4"):
        assert words in said
    assert "StyleImage: done in 3 s [not markup]" in said
    last = said.rpartition("StyleImage")[2]
    assert "all" in last


def test_a_torn_message_is_passed_over():
    said = drawn(b'{"label": "Radi\n', b"\n", message(line="whole"))
    assert "whole" in said


def test_several_workers_share_a_terminal():
    ours, theirs = terminal()
    words = ["ManyOnCores", "--names", '["one", "two"]', "--workers", "2"]
    process = start("luigi", "--module", "build_toys", *words, stderr=theirs)
    os.close(theirs)
    said = screen_of(process, ours)
    os.close(ours)
    assert process.returncode == 0, said
    for name in ("one", "two"):
        assert f"OnCores {name}: started" in said
        assert f"OnCores {name}: done in" in said
    assert "Traceback" not in said


def test_what_a_command_says_after_the_board_has_ended_is_shown():
    """As a grid does of its night."""
    ours, theirs = terminal()
    code = """
import atexit, logging
import pipeline.board
pipeline.board.workers_of_command = lambda: 2
from pipeline.board import board_of_command
from pipeline.logs import Screen
logging.getLogger("pipeline").addHandler(Screen())
logging.getLogger("pipeline").setLevel("INFO")
atexit.register(lambda: logging.getLogger("pipeline").info("4 cells: 4 made"))
board_of_command().say("begun")
"""
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        stderr=theirs, cwd=ROOT, env=os.environ | {"TERM": "xterm"},
    )  # fmt: skip
    os.close(theirs)
    said = screen_of(process, ours)
    os.close(ours)
    assert said.index("begun") < said.index("4 cells: 4 made")


def test_a_board_that_is_gone_is_no_reason_to_fail():
    reading, writing = os.pipe()
    os.close(reading)
    assert not Board(writing).say("to nobody")
    line = BoardLine("RadianceField", Board(writing))
    line(1, 2, psnr=20.0)
    line.say("something")
    line.close()
    os.close(writing)


class Seen:
    """Notes what it is shown."""

    def __init__(self):
        self.calls = []

    def __call__(self, done, total, **quality):
        self.calls.append((done, total, quality))

    def say(self, line):
        self.calls.append(line)

    def close(self):
        self.calls.append("closed")


def test_a_build_tells_by_its_pipe_what_is_shown_elsewhere():
    reading, writing = os.pipe()
    channel = Channel(writing)
    channel(1, 10, loss=float("nan"))
    channel.say("careful: \u20ac")
    os.write(writing, b'{"kind": "bui')
    os.write(writing, b'\n{"kind": "built", "seconds": 1.5}\n')
    os.close(writing)
    seen = Seen()
    with os.fdopen(reading, "rb") as lines:
        assert follow(lines, seen) == {"kind": "built", "seconds": 1.5}
    (done, total, quality), said = seen.calls
    assert (done, total, said) == (1, 10, "careful: \u20ac")
    assert list(quality) == ["loss"]


def test_it_is_told_five_times_a_second_at_most_but_for_a_new_phase():
    reading, writing = os.pipe()
    channel = Channel(writing)
    for k in range(1000):
        channel(k, 1000)
    channel(0, 7)
    os.close(writing)
    seen = Seen()
    with os.fdopen(reading, "rb") as lines:
        follow(lines, seen)
    assert seen.calls[0][:2] == (0, 1000)
    assert seen.calls[-1][:2] == (0, 7)
    assert len(seen.calls) < 20
