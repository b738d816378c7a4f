"""The display of one build: a bar or a live line, and the page of luigid."""

import contextlib
import multiprocessing
import os
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import luigi

from pipeline.console.progress import ProgressBar
from pipeline.console.progress_client import ProgressLine, progress_client
from pipeline.job import Display

_SECONDS_BETWEEN_REPORTS = 5.0


def open_closed_stderr() -> None:
    """Opens standard error, on nothing, if the caller of this process has closed it (`2>&-`)."""
    if sys.stderr is None:
        sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115  open as long as this process


@contextlib.contextmanager
def build_display(task: luigi.Task, label: str, expected_s: float) -> Iterator[Display]:
    """Shows a build under its label while the block runs.

    Args:
        task: The task that is built; under luigid its page shows the percentage.
        label: The name of the build on the screen.
        expected_s: The time it is expected to take, for the total of the command.
    """
    display: Display = ProgressBar(label, sys.stderr, interactive=is_interactive())
    with contextlib.ExitStack() as stack:
        if client := progress_client():
            display = ProgressLine(label, client)
            display(0, 1)  # the line appears at once
            stack.callback(client.remove, label, expected_s)
        if not luigi.interface.core().local_scheduler:  # type: ignore[no-untyped-call]
            display = stack.enter_context(_LuigidDisplay(task, display))
        yield display


class _LuigidDisplay:
    """Another display that also reports the percentage to luigid.

    A thread reports every five seconds: a call to a luigid that does not answer would block the
    build.
    """

    def __init__(self, task: luigi.Task, display: Display) -> None:
        self._task, self._display, self._percent = task, display, 0
        self._is_over = threading.Event()
        self._reporter = threading.Thread(target=self._report, daemon=True)

    def __enter__(self) -> Display:
        self._reporter.start()
        return self

    def __exit__(self, *_raised: object) -> None:
        self._is_over.set()

    def __call__(self, done: int, total: int, **quality: float) -> None:
        """Shows `done` of `total` and the quality."""
        self._percent = 100 * done // max(total, 1)
        self._display(done, total, **quality)

    def say(self, line: str) -> None:
        """Shows a line that stays on the screen."""
        self._display.say(line)

    def close(self) -> None:
        """Removes the progress from the screen."""
        self._display.close()

    def _report(self) -> None:
        reported = 0
        while not self._is_over.wait(_SECONDS_BETWEEN_REPORTS):
            if self._percent != reported:
                reported = self._percent
                with contextlib.suppress(Exception):  # a missing page does not stop a build
                    self._task.set_progress_percentage(reported)  # type: ignore[misc]


def is_interactive() -> bool:
    """Whether this process may draw a bar on standard error.

    It may on a terminal that has a width, unless it is a parallel worker.
    """
    is_alone = multiprocessing.parent_process() is None
    return is_alone and os.isatty(2) and os.get_terminal_size(2).columns > 0
