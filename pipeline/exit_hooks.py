"""Functions that a process calls before it exits, and how the process ends."""

import concurrent.futures.thread  # noqa: F401  first, so that its pools close after the hooks
import multiprocessing
import os
import sys
import threading
from collections.abc import Callable
from typing import NoReturn


def register_exit_hook(hook: Callable[[], None]) -> Callable[[], None]:
    """Registers a function that this process calls when its main thread has ended.

    Hooks run in reverse order of registration, each even if another failed. They may start threads,
    as clients of S3 do; `atexit` runs too late for that. Registration has no effect in a forked
    process (Luigi's workers, or its `--parallel-scheduling`), and a forked process runs no hook.

    Returns:
        A function that cancels the hook.
    """
    process, is_canceled = os.getpid(), threading.Event()

    def run() -> None:
        """Call the hook, unless it was canceled or this is a forked process."""
        if os.getpid() != process or is_canceled.is_set():
            return
        try:
            hook()
        except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001  the other hooks run, too
            sys.excepthook(type(error), error, error.__traceback__)

    if multiprocessing.parent_process() is None:
        threading._register_atexit(run)  # type: ignore[attr-defined]
    return is_canceled.set


def restart_process() -> NoReturn:
    """Replaces this process by one that runs the same command line from the start."""
    sys.stdout.flush()
    sys.stderr.flush()
    os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])  # noqa: S606


def was_interrupted() -> bool:
    """Whether this process ends because of Ctrl-C."""
    return issubclass(getattr(sys, "last_type", None) or type(None), KeyboardInterrupt)
