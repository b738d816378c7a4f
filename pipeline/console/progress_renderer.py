"""`python -m pipeline.console.progress_renderer`: draws the messages of a `ProgressClient`.

It reads them from standard input and draws on standard error.
"""

import contextlib
import json
import sys
from collections.abc import Iterable
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn


def render(messages: Iterable[bytes]) -> None:
    """Draws messages until one of them closes the display."""
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
            with contextlib.suppress(ValueError):  # a killed process wrote half a message
                if not lines.apply(json.loads(message)):
                    return


class _Lines:
    """The live lines, by label, and the line of the total."""

    def __init__(self, progress: Progress) -> None:
        self._progress, self._lines = progress, dict[str, TaskID]()
        self._total: TaskID | None = None

    def apply(self, message: dict[str, Any]) -> bool:
        """Draws a message; returns False if it closes the display."""
        progress = self._progress
        if "line" in message:
            end = "" if message.get("continues") else "\n"
            progress.console.print(
                message["line"], end=end, markup=False, highlight=False, soft_wrap=True
            )
        elif "label" in message:
            self._draw(**message)
        elif "removed" in message:
            if (line := self._lines.pop(message["removed"], None)) is not None:
                progress.remove_task(line)
            if self._total is not None:
                progress.advance(self._total, message["expected_s"])
        elif "expected_s" in message:
            self._total = progress.add_task("all", total=message["expected_s"], quality="")
        return "close" not in message

    def _draw(self, label: str, done: int, total: int, quality: str) -> None:
        if label not in self._lines:
            self._lines[label] = self._progress.add_task(label, total=total, quality="")
        self._progress.update(self._lines[label], completed=done, total=total, quality=quality)


if __name__ == "__main__":
    render(sys.stdin.buffer)
