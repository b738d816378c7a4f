"""One build a card: the cards of this host, as units to lend (`pipeline.execution.host_locks`)."""

import contextlib
import os
import re
import subprocess
from collections.abc import Callable, Iterator, Sequence
from typing import TypeAlias

from pipeline.errors import StoreError
from pipeline.execution.host_locks import acquire, open_locks
from pipeline.settings import setting

Lease: TypeAlias = tuple[dict[str, str], tuple[int, ...]]
"""Variables for a build's environment, and open files for it to hold."""
VISIBLE = "CUDA_VISIBLE_DEVICES"
CARD = re.compile(r"^(?:GPU(?!.*\n\s+MIG)|\s+MIG).*\(UUID: (.*)\)", re.MULTILINE)
"""In what `nvidia-smi -L` prints: a whole card, or the parts of one that was divided."""


@contextlib.contextmanager
def leased(say_so: Callable[[], object], most: int = 1) -> Iterator[Lease]:
    """Hold a card that nobody else has; call `say_so` once where others hold all of them.

    Args:
        say_so: To be called.
        most: How many cards to hold where so many are free.

    Returns:
        What shows a build these cards alone, and the files whose flocks hold them; nothing where
        there are no cards.

    Raises:
        StoreError: When the cards cannot be listed, or the folder of leases cannot be used.
    """
    with open_locks("gpu", visible_cards()) as files:
        taken = acquire(files, 1, most, say_so) if files else []
        yield ({VISIBLE: ",".join(taken)} if taken else {}), tuple(files[c] for c in taken)


def visible_cards() -> list[str]:
    """The cards of this host that CUDA_VISIBLE_DEVICES does not hide, by their UUIDs.

    Raises:
        StoreError: When they cannot be listed.
    """
    return visible(_cards(), os.environ.get(VISIBLE))


def visible(cards: Sequence[str], wanted: str | None) -> list[str]:
    """Those of `cards` that a CUDA_VISIBLE_DEVICES names: by number, or by how the UUID begins."""
    if wanted is None:
        return list(cards)
    words = [word.strip() for word in wanted.split(",") if word.strip()]
    numbered = list(enumerate(cards))
    return [c for word in words for n, c in numbered if word == str(n) or c.startswith(word)]


def _cards() -> list[str]:
    if cards := setting("gpu", "cards"):
        return cards.replace(",", " ").split()
    try:
        ask = ["nvidia-smi", "-L"]
        return CARD.findall(subprocess.check_output(ask, text=True, timeout=60))
    except FileNotFoundError:
        return []
    except (OSError, subprocess.SubprocessError) as error:
        reason = str(error).rstrip(".")
        remedy = "Name the cards of this host by their UUIDs in [gpu] cards."
        raise StoreError(f"no GPU can be leased: {reason}. {remedy}") from error
