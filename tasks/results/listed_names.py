"""Lists of names on the command line, such as `--scenes` and `--styles`."""

from collections.abc import Sequence
from typing import Any

from styletrf.errors import InputError


def require_names(option: str, names: Sequence[Any]) -> None:
    """Rejects a list with an entry that is not a name, or that it has twice.

    Args:
        option: The option that has the list, such as `--styles`.
        names: The entries of the list.

    Raises:
        InputError: The list has such an entry.
    """
    subject = f"{option} {list(names)}"
    if not all(isinstance(name, str) and name for name in names):
        problem = "contains an entry that is not the name of a folder or an image"
        raise InputError(subject, problem, 'Give a list such as ["mosaic"]')
    if len(set(names)) < len(names):
        raise InputError(subject, "names one twice", "Name each once")
