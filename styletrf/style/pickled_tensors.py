"""Reads files of `torch.save` that users bring. Nothing in them is run."""

from pathlib import Path
from typing import Any

import torch

from styletrf.errors import InputError


def read_pickled(path: Path, kind: str, remedy: str) -> Any:
    """Returns what `torch.save` wrote: tensors on the CPU, and tables, lists and numbers of them.

    Args:
        path: The file.
        kind: What the file should be, such as "VGG16 weights".
        remedy: What the user can do if it is something else.

    Raises:
        InputError: The file cannot be read, or is something else.
        MemoryError: It is larger than the memory.
    """
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except MemoryError:
        raise
    except Exception as error:  # bytes that are no pickle make an unpickler raise anything
        said = f"{type(error).__name__}: {error}".partition("\n")[0].rstrip(": ")
        reason = getattr(error, "strerror", None) or said
        raise InputError(str(path), f"cannot be read as {kind} ({reason})", remedy) from error
