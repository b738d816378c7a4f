"""Imported before numba and torch: this process waits and keeps freed memory as builds do."""

import ctypes
import os

from pipeline.execution.environment import allocator_settings, build_settings

MALLOPT = {"MALLOC_TRIM_THRESHOLD_": -1, "MALLOC_MMAP_THRESHOLD_": -3}
"""The numbers of glibc's `mallopt` for variables that it reads before Python begins."""


def set_here() -> None:
    """Sets the variables of builds, but for those that the user has set."""
    of_allocator = allocator_settings(os.environ)
    os.environ.update(build_settings(os.environ))
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        for name, value in of_allocator.items():
            mallopt(MALLOPT[name], int(value))


set_here()
