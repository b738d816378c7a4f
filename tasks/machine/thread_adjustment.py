"""The display of a build whose threads follow the cores that other work leaves free."""

from typing import final

from pipeline.job import Display
from styletrf.free_cores import FreeCoreThreads


@final
class ThreadAdjustment(Display):
    """Shows what another display shows; its reports adjust the threads of their caller.

    How many threads compute decides no result but the rounding of sums, so keys do not cover it.
    """

    def __init__(self, display: Display) -> None:
        self._display = display
        self._threads = FreeCoreThreads()

    def __call__(self, done: int, total: int, **quality: float) -> None:
        """Shows the work done, and adjusts the threads."""
        self._display(done, total, **quality)
        self._threads.adjust()

    def say(self, line: str) -> None:
        """Shows a line that stays on the screen."""
        self._display.say(line)

    def close(self) -> None:
        """Removes the progress from the screen."""
        self._display.close()
