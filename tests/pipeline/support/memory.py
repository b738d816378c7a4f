"""Folders in memory, where a flush takes no time.

A flush to a disk takes ten milliseconds, and each artifact takes several. What a killed process has
written outlives it, flushed or not; only a power failure would tell a disk from memory.
"""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

MEMORY = Path("/dev/shm")


@contextmanager
def folder_in_memory(otherwise: Path, config: pytest.Config) -> Iterator[Path]:
    """An empty folder in memory, which goes when the test ends.

    It is the other one, which stays, if the user gave `--basetemp`, or if memory has no room or
    starts no programs.
    """
    if is_to_be_kept(config) or not is_usable():
        yield otherwise
        return
    with TemporaryDirectory(dir=MEMORY, ignore_cleanup_errors=True) as folder:
        yield Path(folder)


def is_to_be_kept(config: pytest.Config) -> bool:
    """Whether the user gave `--basetemp`; pytest-xdist gives one to each of its workers."""
    return bool(config.option.basetemp) and not hasattr(config, "workerinput")


def is_usable() -> bool:
    if not os.access(MEMORY, os.W_OK) or os.statvfs(MEMORY).f_flag & os.ST_NOEXEC:
        return False
    return shutil.disk_usage(MEMORY).free > 1 << 30
