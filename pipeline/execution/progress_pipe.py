"""The pipe on which a build tells where it stands: a line of JSON a message."""

import contextlib
import json
import os
import time
from collections.abc import Iterable
from typing import Any

from pipeline.job import Display

_SECONDS_BETWEEN_MESSAGES = 0.2


class ProgressPipe:
    """The build's end of the pipe, as `Display`; that nobody listens is no reason to end."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor, self._total, self._told_s = descriptor, -1, 0.0

    def __call__(self, done: int, total: int, **quality: float) -> None:
        """Tell `done` of `total`, five times a second."""
        now = time.monotonic()
        if total != self._total or now - self._told_s >= _SECONDS_BETWEEN_MESSAGES:
            self._total, self._told_s = total, now
            self.send(done=done, total=total, quality=quality)

    def say(self, line: str) -> None:
        """Tell a line that stays."""
        self.send(line=line)

    def close(self) -> None:
        """Leave the rest to who listens."""

    def send(self, **message: object) -> None:
        """Tell anything that JSON can say."""
        with contextlib.suppress(OSError):
            os.write(self._descriptor, json.dumps(message).encode() + b"\n")


def read_messages(lines: Iterable[bytes], display: Display) -> dict[str, Any]:
    """Show what a build tells, until it ends; returns all other fields, the last word of each."""
    fields: dict[str, Any] = {}
    for line in lines:
        with contextlib.suppress(json.JSONDecodeError):  # a builder was killed at it
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
