"""The pipe on which a build reports its progress, with a line of JSON for each message."""

import contextlib
import json
import os
import time
from collections.abc import Iterable
from typing import Any

from pipeline.job import Display

_SECONDS_BETWEEN_MESSAGES = 0.2


class ProgressPipe:
    """The build's end of the pipe, as a `Display`. A closed pipe does not end the build."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor, self._total, self._sent_s = descriptor, -1, 0.0

    def __call__(self, done: int, total: int, **quality: float) -> None:
        """Reports `done` of `total`, at most five times a second."""
        now = time.monotonic()
        if total != self._total or now - self._sent_s >= _SECONDS_BETWEEN_MESSAGES:
            self._total, self._sent_s = total, now
            self.send(done=done, total=total, quality=quality)

    def say(self, line: str) -> None:
        """Sends a line that stays on the screen."""
        self.send(line=line)

    def close(self) -> None:
        """Does nothing. The reader closes its display."""

    def send(self, **message: object) -> None:
        """Sends a message of these fields."""
        with contextlib.suppress(OSError):
            os.write(self._descriptor, json.dumps(message).encode() + b"\n")


def read_messages(lines: Iterable[bytes], display: Display) -> dict[str, Any]:
    """Shows the messages of a build until it ends; returns the last values of all other fields."""
    fields: dict[str, Any] = {}
    for line in lines:
        with contextlib.suppress(json.JSONDecodeError):  # a builder was killed while writing
            message = json.loads(line)
            if not isinstance(message, dict):
                continue
            if "line" in message:
                display.say(message["line"])
            elif "done" in message:
                display(message["done"], message["total"], **message["quality"])
            else:
                fields |= message
    return fields
