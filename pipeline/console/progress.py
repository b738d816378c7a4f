"""The bar that shows the progress of a build."""

import contextlib
import io
import time
from typing import TextIO

from tqdm import tqdm

tqdm.monitor_interval = 0  # tqdm starts no thread of its own
SECONDS_BETWEEN_LINES = 15.0
_UNWRITABLE = OSError, ValueError  # its reader has ended, its disk is full, or it is closed


class ProgressBar:
    """A bar on a terminal. In a file or a pipe the same text is a line every 15 seconds.

    Args:
        label: The name of what is built.
        stream: Where the bar is drawn.
        interactive: Whether the stream is a terminal on which no other process draws.
    """

    def __init__(self, label: str, stream: TextIO, *, interactive: bool) -> None:
        self._label, self._stream = label, stream
        self._canvas: TextIO = stream if interactive else io.StringIO()
        self._bar: tqdm | None = None
        self._written_s = time.monotonic()

    def __call__(self, done: int, total: int, **quality: float) -> None:
        """Draws `done` of `total`, the rate, the time left and the quality."""
        if self._bar is None or done < self._bar.n or total != self._bar.total:
            self.close()
            self._bar = self._new_bar(done, total)
        self._bar.set_postfix(
            {name: f"{value:.4g}" for name, value in quality.items()}, refresh=False
        )
        self._bar.update(done - self._bar.n)
        if self._canvas is not self._stream:
            self._write_line(self._bar)

    def say(self, line: str) -> None:
        """Writes a line above the bar. A stream that cannot be written does not stop the build."""
        with contextlib.suppress(*_UNWRITABLE):
            tqdm.write(line, file=self._stream)
            self._stream.flush()

    def close(self) -> None:
        """Removes the bar from the terminal."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def _new_bar(self, done: int, total: int) -> tqdm:
        return tqdm(
            total=total,
            initial=done,
            desc=self._label,
            file=self._canvas,
            leave=False,
            dynamic_ncols=True,
            mininterval=0.2,
        )

    def _write_line(self, bar: tqdm) -> None:
        now_s = time.monotonic()
        if now_s - self._written_s >= SECONDS_BETWEEN_LINES:
            self._written_s = now_s
            text = tqdm.format_meter(**{**bar.format_dict, "ncols": 0})
            with contextlib.suppress(*_UNWRITABLE):
                self._stream.write(f"{text.strip()}\n")
                self._stream.flush()
