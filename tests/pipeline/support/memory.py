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


def is_to_be_kept(config: pytest.Config) -> bool:
    """Whether the user gave `--basetemp`; pytest-xdist gives one to each of its workers."""
    return bool(config.option.basetemp) and not hasattr(config, "workerinput")


@contextmanager
def folder_in_memory(otherwise: Path) -> Iterator[Path]:
    """An empty folder in memory; the other one if memory has no room or starts no programs."""
    if not is_usable():
        yield otherwise
        return
    with TemporaryDirectory(dir=MEMORY, ignore_cleanup_errors=True) as folder:
        yield Path(folder)


def is_usable() -> bool:
    if not os.access(MEMORY, os.W_OK) or os.statvfs(MEMORY).f_flag & os.ST_NOEXEC:
        return False
    return shutil.disk_usage(MEMORY).free > 1 << 30
