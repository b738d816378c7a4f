"""A live line for each build that runs, and one for all, where a command runs several at once.

One process draws them, `python -m pipeline.board`, since what they show comes from many: the
command, its workers and their builds write JSON, a line a message, to the pipe it reads.
"""

import contextlib
import functools
import json
import os
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from pipeline.ending import at_end
from pipeline.host import workers_of_command

_LONGEST = 300  # characters of a word; writes of more than 4 KiB to a pipe may be torn
_SECONDS_TO_END = 5.0


@dataclass(frozen=True)
class Board:
    """The pipe to the process that draws.

    Attributes:
        descriptor: Its end for writing, which builds inherit.
        drawer: The process; None in a build.
    """

    descriptor: int
    drawer: "subprocess.Popen[bytes] | None" = None

    def say(self, text: str) -> bool:
        """Show lines that stay, above those that live; False where nobody draws any more."""
        return all(
            self._send(line=line[k : k + _LONGEST], goes_on=len(line) > k + _LONGEST)
            for line in text.splitlines()
            for k in range(0, max(len(line), 1), _LONGEST)
        )

    def expect(self, seconds: float) -> None:
        """Begin the line for all builds, which will take so long together."""
        self._send(expected=seconds)

    def show(self, label: str, done: int, total: int, quality: str) -> None:
        """Draw where a build is."""
        self._send(label=label, done=done, total=total, quality=quality)

    def take_off(self, label: str, seconds: float = 0.0) -> None:
        """Take a build's line off; it was expected to take these seconds of the whole."""
        self._send(gone=label, seconds=seconds)

    def close(self) -> None:
        """Have the process draw what it was told, and end."""
        if self.drawer and self.drawer.poll() is None:
            self._send(end=True)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.drawer.wait(_SECONDS_TO_END)

    def _send(self, **message: object) -> bool:
        """Write a message; that nobody draws any more is no reason to fail."""
        message = {k: v[:_LONGEST] if isinstance(v, str) else v for k, v in message.items()}
        try:
            os.write(self.descriptor, json.dumps(message).encode() + b"\n")
        except OSError:
            return False
        return True


class BoardLine:
    """A build's line on the board, as `pipeline.progress.Progress`."""

    def __init__(self, label: str, board: Board) -> None:
        self._label, self._board = label, board

    def __call__(self, done: int, total: int, **quality: float) -> None:
        """Draw `done` of `total` and the quality."""
        told = " ".join(f"{name} {value:.4g}" for name, value in quality.items())
        self._board.show(self._label, done, total, told)

    def say(self, line: str) -> None:
        """Show a line that stays."""
        self._board.say(line)

    def close(self) -> None:
        """Leave it to whoever runs the build to take the line off."""


@functools.cache
def board_of_command() -> Board | None:
    """The board of this command, drawn from now on: on a terminal, where several builds run."""
    if workers_of_command() == 1 or not os.isatty(2):
        return None
    reading, writing = os.pipe()
    command = [sys.executable, "-P", "-m", "pipeline.board"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with os.fdopen(reading, "rb") as messages:  # a session of its own, which Ctrl-C leaves alone
        drawer = subprocess.Popen(command, stdin=messages, start_new_session=True, env=environment)
    board = Board(writing, drawer)
    at_end(board.close)
    return board


def draw(messages: Iterable[bytes]) -> None:
    """Draw what comes, until it says that it ends."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(20),
        TextColumn("{task.percentage:>3.0f}%"),
        TimeRemainingColumn(compact=True),
        TextColumn("{task.fields[quality]}", markup=False),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        lines = _Lines(progress)
        for message in messages:
            with contextlib.suppress(ValueError):  # torn by a writer that was killed
                if not lines.take(json.loads(message)):
                    return


class _Lines:
    """The lines of a `rich.progress.Progress`, by label."""

    def __init__(self, progress: Any) -> None:
        self._progress, self._lines = progress, dict[str, Any]()
        self._all: Any = None

    def take(self, message: dict[str, Any]) -> bool:
        """Draw a message; returns whether there are more to come."""
        progress = self._progress
        if "line" in message:
            end = "" if message.get("goes_on") else "\n"
            style = {"markup": False, "highlight": False, "soft_wrap": True}
            progress.console.print(message["line"], end=end, **style)
        elif "label" in message:
            self._draw(**message)
        elif "gone" in message:
            if (line := self._lines.pop(message["gone"], None)) is not None:
                progress.remove_task(line)
            if self._all is not None:
                progress.advance(self._all, message["seconds"])
        elif "expected" in message:
            self._all = progress.add_task("all", total=message["expected"], quality="")
        return "end" not in message

    def _draw(self, label: str, done: int, total: int, quality: str) -> None:
        if label not in self._lines:
            self._lines[label] = self._progress.add_task(label, total=total, quality="")
        self._progress.update(self._lines[label], completed=done, total=total, quality=quality)


if __name__ == "__main__":
    draw(sys.stdin.buffer)
