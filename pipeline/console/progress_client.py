"""The sender of a live display, which has a line for each of several running builds.

The command, its workers and their builds are separate processes. They write JSON messages, one on
each line, to a pipe. One process reads the pipe and draws: `progress_renderer.py`.
"""

import contextlib
import functools
import json
import os
import subprocess
import sys
from dataclasses import dataclass

from pipeline.code.interpreters import interpreter_environment
from pipeline.parameters import workers_of_command

_MAX_CHARACTERS = 300  # of a string; Linux may split a write of more than 4 KiB to a pipe
_SECONDS_TO_CLOSE = 5.0


@dataclass(frozen=True)
class ProgressClient:
    """The pipe to the process that draws. No method fails when that process has ended.

    Attributes:
        descriptor: The end of the pipe to write to, which builds inherit.
        renderer: The process that draws; None in a build.
    """

    descriptor: int
    renderer: "subprocess.Popen[bytes] | None" = None

    def write(self, text: str) -> bool:
        """Shows lines that stay above the live ones; returns False if no process draws them."""
        return all(
            self._send(
                line=line[k : k + _MAX_CHARACTERS], continues=len(line) > k + _MAX_CHARACTERS
            )
            for line in text.splitlines()
            for k in range(0, max(len(line), 1), _MAX_CHARACTERS)
        )

    def start_total(self, expected_s: float) -> None:
        """Shows a line for all builds together, with their expected time."""
        self._send(expected_s=expected_s)

    def update(self, label: str, done: int, total: int, quality: str) -> None:
        """Draws the line of a build."""
        self._send(label=label, done=done, total=total, quality=quality)

    def remove(self, label: str, expected_s: float = 0.0) -> None:
        """Removes the line of a build, and adds its expected time to the total."""
        self._send(removed=label, expected_s=expected_s)

    def close(self) -> None:
        """Waits until the renderer has drawn all messages and has ended."""
        if self.renderer and self.renderer.poll() is None:
            self._send(close=True)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.renderer.wait(_SECONDS_TO_CLOSE)

    def _send(self, **message: object) -> bool:
        """Writes a message; returns False if no process reads the pipe."""
        message = {k: v[:_MAX_CHARACTERS] if isinstance(v, str) else v for k, v in message.items()}
        try:
            os.write(self.descriptor, json.dumps(message).encode() + b"\n")
        except OSError:
            return False
        return True


class ProgressLine:
    """The live line of one build; implements `pipeline.job.Display`."""

    def __init__(self, label: str, client: ProgressClient) -> None:
        self._label, self._client = label, client

    def __call__(self, done: int, total: int, **quality: float) -> None:
        """Draws `done` of `total` and the quality."""
        text = " ".join(f"{name} {value:.4g}" for name, value in quality.items())
        self._client.update(self._label, done, total, text)

    def say(self, line: str) -> None:
        """Shows a line that stays on the screen."""
        self._client.write(line)

    def close(self) -> None:
        """Does nothing. The process that runs the build removes the line."""


@functools.cache
def progress_client() -> ProgressClient | None:
    """Returns the client of this command, whose renderer starts with the first call.

    Returns:
        None without a live display: not on a terminal, or with one worker.
    """
    if workers_of_command() == 1 or not os.isatty(2):
        return None
    reading, writing = os.pipe()
    command = [sys.executable, "-P", "-m", "pipeline.console.progress_renderer"]
    with os.fdopen(reading, "rb") as messages:  # in a session of its own, Ctrl-C does not end it
        renderer = subprocess.Popen(
            command, stdin=messages, start_new_session=True, env=interpreter_environment()
        )
    return ProgressClient(writing, renderer)


def close_progress() -> None:
    """Ends the live display of this command, if there is one; later records are written below."""
    if progress_client.cache_info().currsize and (client := progress_client()):
        client.close()
