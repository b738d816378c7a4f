"""One build a card: a lease on a GPU of this host, whatever users and stores it has.

A lease is the flock of a file named after the card. The build's own processes hold it, so it goes
with the last of them, however they end. Like every lock here, it spares trouble and proves nothing.
"""

import contextlib
import functools
import os
import re
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeAlias

from pipeline.errors import StoreError
from pipeline.locks import try_lock
from pipeline.settings import setting

Lease: TypeAlias = tuple[dict[str, str], tuple[int, ...]]
"""Variables for a build's environment, and open files for it to hold."""
VISIBLE = "CUDA_VISIBLE_DEVICES"
_SECONDS_BETWEEN_LOOKS = 0.5
CARD = re.compile(r"^(?:GPU(?!.*\n\s+MIG)|\s+MIG).*\(UUID: (.*)\)", re.MULTILINE)
"""In what `nvidia-smi -L` prints: a whole card, or the parts of one that was divided."""


@contextlib.contextmanager
def leased(say_so: Callable[[], object]) -> Iterator[Lease]:
    """Hold a card that nobody else has; call `say_so` once where others hold all of them.

    Returns:
        What shows a build this card alone, and the file whose flock holds it; nothing where there
        are no cards.

    Raises:
        StoreError: When the cards cannot be told, or the folder of leases cannot be used.
    """
    say_once, card = functools.cache(say_so), None
    files = {card: _open(card) for card in visible(_cards(), os.environ.get(VISIBLE))}
    try:
        while files and not (card := next((c for c in files if try_lock(files[c])), None)):
            say_once()
            time.sleep(_SECONDS_BETWEEN_LOOKS)
        yield ({VISIBLE: card}, (files[card],)) if card else ({}, ())
    finally:
        for file in files.values():
            os.close(file)


def visible(cards: Sequence[str], wanted: str | None) -> list[str]:
    """Those of `cards` that a CUDA_VISIBLE_DEVICES names: by number, or by how the UUID begins."""
    if wanted is None:
        return list(cards)
    words = [word.strip() for word in wanted.split(",") if word.strip()]
    numbered = list(enumerate(cards))
    return [c for word in words for n, c in numbered if word == str(n) or c.startswith(word)]


def _cards() -> list[str]:
    if told := setting("gpu", "cards"):
        return told.replace(",", " ").split()
    try:
        ask = ["nvidia-smi", "-L"]
        return CARD.findall(subprocess.check_output(ask, text=True, timeout=60))
    except FileNotFoundError:
        return []
    except (OSError, subprocess.SubprocessError) as error:
        reason = str(error).rstrip(".")
        remedy = "Name the cards of this host by their UUIDs in [gpu] cards."
        raise StoreError(f"no GPU can be leased: {reason}. {remedy}") from error


def _open(card: str) -> int:
    """The card's file, which another user may have made; ours can be opened by others."""
    folder = Path(setting("gpu", "leases"))
    umask = os.umask(0)
    try:
        folder.mkdir(mode=0o1777, exist_ok=True)
        with contextlib.suppress(FileExistsError):
            (folder / f"gpu-{card}").touch(0o644, exist_ok=False)
        return os.open(folder / f"gpu-{card}", os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW)
    except OSError as error:
        remedy = "Name a folder that all users of this host can write to in [gpu] leases."
        raise StoreError(f"no GPU can be leased: {error}. {remedy}") from error
    finally:
        os.umask(umask)
