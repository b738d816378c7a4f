"""How a build tells where it stands, and how that is shown."""

import contextlib
import io
import time
from typing import Protocol, TextIO

from tqdm import tqdm

tqdm.monitor_interval = 0  # no thread of its own
SECONDS_BETWEEN_LINES = 15.0


class Progress(Protocol):
    """Called with the work done so far, the whole of it, and the quality reached (psnr, loss)."""

    def __call__(self, done: int, total: int, **quality: float) -> None:
        """Report `done` of `total` units of work; both may restart for a further phase."""


class Display(Progress, Protocol):
    """Where it is shown how a build goes."""

    def say(self, line: str) -> None:
        """Show a line that stays."""

    def close(self) -> None:
        """Take off what does not."""


class ProgressBar:
    """A bar on a terminal; elsewhere (a file, a pipe) the same text, a line now and then.

    Args:
        label: What is being built.
        stream: Where to draw.
        interactive: Whether the stream is a terminal that nobody else draws on.
    """

    def __init__(self, label: str, stream: TextIO, *, interactive: bool) -> None:
        self._label, self._stream = label, stream
        self._canvas: TextIO = stream if interactive else io.StringIO()
        self._bar: tqdm | None = None
        self._written = time.monotonic()

    def __call__(self, done: int, total: int, **quality: float) -> None:
        """Draw `done` of `total`, the rate, the time that remains and the quality."""
        if self._bar is None or done < self._bar.n or total != self._bar.total:
            self.close()
            self._bar = self._begin(done, total)
        self._bar.set_postfix(
            {name: f"{value:.4g}" for name, value in quality.items()}, refresh=False
        )
        self._bar.update(done - self._bar.n)
        if self._canvas is not self._stream:
            self._write_line(self._bar)

    def say(self, line: str) -> None:
        """Write a line above the bar; a terminal that is gone is no reason to end."""
        with contextlib.suppress(OSError):
            tqdm.write(line, file=self._stream)
            self._stream.flush()

    def close(self) -> None:
        """Take the bar off the terminal."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def _begin(self, done: int, total: int) -> tqdm:
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
        now = time.monotonic()
        if now - self._written >= SECONDS_BETWEEN_LINES:
            self._written = now
            text = tqdm.format_meter(**{**bar.format_dict, "ncols": 0})
            self._stream.write(f"{text.strip()}\n")
            self._stream.flush()
