"""Results computed a few steps ahead of their use, in threads, in order."""

from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from itertools import count, islice, takewhile
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def prefetch(
    function: Callable[[Item], Result], items: Iterable[Item], *, threads: int, ahead: int
) -> Generator[Result, None, None]:
    """Yields `function(item)` for each item, in order, with at most `ahead` results in waiting.

    `items` may be endless. An exception of `function` is raised in its turn, and one of `items` as
    soon as it occurs. Closing the iterator drops the calls that have not begun.

    Args:
        function: Safe to call from several threads at once.
        items: Iterated in the caller's thread.
        threads: How many calls run at a time.
        ahead: How many calls may be started or done before their result is needed, at least one.

    Raises:
        ValueError: `ahead` is less than one.
    """
    if ahead < 1:
        raise ValueError(f"{ahead} calls ahead give no result")
    remaining = iter(items)
    executor = ThreadPoolExecutor(threads)
    try:
        waiting: deque[Future[Result]] = deque(
            executor.submit(function, item) for item in islice(remaining, ahead)
        )
        while waiting:
            result = waiting.popleft().result()
            waiting.extend(executor.submit(function, item) for item in islice(remaining, 1))
            yield result
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def in_background(items: Iterable[Item], *, ahead: int) -> Generator[Item, None, None]:
    """Yields the items, of which a thread takes up to `ahead` before they are needed.

    An exception of the items is raised in its turn. Closing the iterator ends the thread.
    """
    remaining, end = iter(items), object()
    taken = prefetch(lambda _: next(remaining, end), count(), threads=1, ahead=ahead)
    with closing(taken):
        yield from takewhile(lambda item: item is not end, taken)
