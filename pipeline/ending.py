"""What a process still does at its end, while threads can be started: clients of S3 start some."""

import concurrent.futures.thread  # noqa: F401  first, so that its pools are closed after what is asked
import multiprocessing
import os
import sys
import threading
from collections.abc import Callable
from typing import NoReturn


def at_end(act: Callable[[], None]) -> Callable[[], None]:
    """Has this process, not those forked off it, do something when all else is done.

    Asked in one that was forked off (as Luigi's `--parallel-scheduling` does), it does nothing.
    What was asked for first is done last. `atexit` would come too late: by then no thread pool
    takes anything more.

    Returns:
        What takes it back.
    """
    process, taken_back = os.getpid(), threading.Event()

    def run() -> None:
        """Do it, unless it was taken back or this is another process."""
        if os.getpid() != process or taken_back.is_set():
            return
        try:
            act()
        except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001  the others are done, too
            sys.excepthook(type(error), error, error.__traceback__)

    if multiprocessing.parent_process() is None:
        threading._register_atexit(run)  # type: ignore[attr-defined]
    return taken_back.set


def begin_again() -> NoReturn:
    """Have this process run its own command line once more, from the start."""
    sys.stdout.flush()
    sys.stderr.flush()
    os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])  # noqa: S606


def was_interrupted() -> bool:
    """Whether the process ends because of Ctrl-C."""
    return issubclass(getattr(sys, "last_type", None) or type(None), KeyboardInterrupt)
