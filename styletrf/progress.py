"""The interface by which a long computation reports its progress to its caller."""

from typing import Protocol, runtime_checkable


@runtime_checkable
class Progress(Protocol):
    """Called with the work done so far, the whole of it, and the quality reached (psnr, loss)."""

    def __call__(self, done: int, total: int, **quality: float) -> None:
        """Reports `done` of `total` units of work; both may restart for a further phase."""


def silent(done: int, total: int, **quality: float) -> None:
    """Reports nothing."""
