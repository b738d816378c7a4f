"""Where a command shows how its builds go: its terminal, its board, and luigid's page."""

import contextlib
import multiprocessing
import os
import sys
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING

import luigi

from pipeline.board import BoardLine, board_of_command
from pipeline.progress import Display, ProgressBar

if TYPE_CHECKING:
    from pipeline.task import StoredTask

_SECONDS_BETWEEN_REPORTS = 5.0


@contextlib.contextmanager
def display_of(task: "StoredTask", seconds: float) -> Iterator[Display]:
    """What shows a build of the task, which is expected to take these seconds."""
    board = board_of_command()
    shown: Display = (
        BoardLine(task.label, board)
        if board
        else ProgressBar(task.label, sys.stderr, interactive=is_interactive())
    )
    if board:
        shown(0, 1)  # it has begun
    try:
        if luigi.interface.core().local_scheduler:  # type: ignore[no-untyped-call]
            yield shown
        else:
            with _Reported(task, shown) as reported:
                yield reported
    finally:
        if board:
            board.take_off(task.label, seconds)


class _Reported:
    """Another display, and the page of a luigid, which hears of it now and then.

    By a thread of its own, for a luigid that is away keeps whoever calls it waiting.
    """

    def __init__(self, task: "StoredTask", shown: Display) -> None:
        self._task, self._shown, self._percent = task, shown, 0
        self._is_over = threading.Event()
        self._reporter = threading.Thread(target=self._report, daemon=True)

    def __enter__(self) -> Display:
        self._reporter.start()
        return self

    def __exit__(self, *_raised: object) -> None:
        self._is_over.set()

    def __call__(self, done: int, total: int, **quality: float) -> None:
        """Show `done` of `total` and the quality."""
        self._percent = 100 * done // max(total, 1)
        self._shown(done, total, **quality)

    def say(self, line: str) -> None:
        """Show a line that stays."""
        self._shown.say(line)

    def close(self) -> None:
        """Take off what does not."""
        self._shown.close()

    def _report(self) -> None:
        told = 0
        while not self._is_over.wait(_SECONDS_BETWEEN_REPORTS):
            if self._percent != told:
                told = self._percent
                with contextlib.suppress(Exception):  # a page is no reason to fail
                    self._task.set_progress_percentage(told)  # type: ignore[misc]


def is_interactive() -> bool:
    """Whether one bar may be drawn on standard error: a wide terminal, no parallel worker."""
    is_alone = multiprocessing.parent_process() is None
    return is_alone and os.isatty(2) and os.get_terminal_size(2).columns > 0
