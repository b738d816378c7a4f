"""Leases of the GPUs of this host, each for one build (`pipeline.execution.host_locks`)."""

import contextlib
import functools
import logging
import os
import re
import subprocess
from collections.abc import Callable, Iterator, Sequence
from typing import TypeAlias

from pipeline.errors import StoreError
from pipeline.execution.host_locks import acquire, open_locks
from pipeline.settings import setting

_log = logging.getLogger("pipeline")
Lease: TypeAlias = tuple[dict[str, str], tuple[int, ...]]
"""Variables for the environment of a build, and open files whose flocks are its leases."""
VISIBLE = "CUDA_VISIBLE_DEVICES"
UUID_LINE = re.compile(r"^(?:GPU(?!.*\n\s+MIG)|\s+MIG).*\(UUID: (.*)\)", re.MULTILINE)
"""A line of `nvidia-smi -L` with the UUID of a whole GPU, or of a part of a divided GPU."""


@contextlib.contextmanager
def leased(on_wait: Callable[[], object], most: int = 1) -> Iterator[Lease]:
    """Holds a free GPU; calls `on_wait` once if other builds hold all of them.

    Args:
        on_wait: Called if the build has to wait.
        most: How many GPUs to hold, if enough are free.

    Yields:
        The variable that shows a build these GPUs only, and the files whose flocks are the leases.
        Both are empty on a host without GPUs.

    Raises:
        StoreError: The GPUs cannot be listed, or the folder of leases cannot be used.
    """
    with open_locks("gpu", visible_gpus()) as files:
        taken = acquire(files, 1, most, on_wait) if files else []
        yield ({VISIBLE: ",".join(taken)} if taken else {}), tuple(files[gpu] for gpu in taken)


def visible_gpus() -> list[str]:
    """Returns the UUIDs of the GPUs of this host that CUDA_VISIBLE_DEVICES allows.

    Raises:
        StoreError: The GPUs cannot be listed.
    """
    return visible(_gpus(), os.environ.get(VISIBLE))


def visible(gpus: Sequence[str], allowed: str | None) -> list[str]:
    """Returns the GPUs in a CUDA_VISIBLE_DEVICES: by number, or by the start of the UUID."""
    if allowed is None:
        return list(gpus)
    words = [word.strip() for word in allowed.split(",") if word.strip()]
    numbered = list(enumerate(gpus))
    return [gpu for word in words for n, gpu in numbered if word == str(n) or gpu.startswith(word)]


def _gpus() -> list[str]:
    if uuids := setting("gpu", "uuids") or _former_uuids():
        return uuids.replace(",", " ").split()
    try:
        ask = ["nvidia-smi", "-L"]
        return UUID_LINE.findall(subprocess.check_output(ask, text=True, timeout=60))
    except FileNotFoundError:
        return []
    except (OSError, subprocess.SubprocessError) as error:
        reason = str(error).rstrip(".")
        remedy = "Name the UUIDs of the GPUs of this host in [gpu] uuids."
        raise StoreError(f"no GPU can be leased: {reason}. {remedy}") from error


def _former_uuids() -> str:
    """Returns the UUIDs under the setting's name of earlier versions."""
    if uuids := setting("gpu", "cards"):
        _warn_of_former_name()
    return uuids


@functools.cache
def _warn_of_former_name() -> None:
    _log.warning("[gpu] cards of luigi.cfg is now [gpu] uuids; use the new name.")
