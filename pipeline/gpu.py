"""One build a card: a lease on a GPU of this host, whatever users and stores it has.

A lease is the flock of a file named after the card. The build's own processes hold it, so it goes
with the last of them, however they end. Like every lock here, it spares trouble and proves nothing.
"""

import contextlib
import os
import re
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from pipeline.errors import StoreError
from pipeline.locks import try_lock
from pipeline.settings import setting

VISIBLE = "CUDA_VISIBLE_DEVICES"
_SECONDS_BETWEEN_LOOKS = 0.5
_CARD = re.compile(r"^(?:GPU(?!.*\n\s+MIG)|\s+MIG).*\(UUID: (.*)\)", re.MULTILINE)
"""In what `nvidia-smi -L` prints: a whole card, or the parts of one that was divided."""


@contextlib.contextmanager
def leased(on_wait: Callable[[], object]) -> Iterator[tuple[str | None, int | None]]:
    """Hold a card that nobody else has; call `on_wait` first where others hold all of them.

    Returns:
        The card's UUID, and the descriptor whose flock holds it; two times None without cards.

    Raises:
        StoreError: When the folder of leases cannot be used.
    """
    files = {card: _open(card) for card in visible(_cards(), os.environ.get(VISIBLE))}
    try:
        card = _first_free(files)
        if files and not card:
            on_wait()
        while files and not card:
            time.sleep(_SECONDS_BETWEEN_LOOKS)
            card = _first_free(files)
        yield card, files.get(card or "")
    finally:
        for file in files.values():
            os.close(file)


def _first_free(files: Mapping[str, int]) -> str | None:
    return next((card for card, file in files.items() if try_lock(file)), None)


def visible(cards: Sequence[str], wanted: str | None) -> list[str]:
    """Those of `cards` that a CUDA_VISIBLE_DEVICES names: by number, or by how the UUID begins."""
    if wanted is None:
        return list(cards)
    words = [word.strip() for word in wanted.split(",") if word.strip()]
    numbered = list(enumerate(cards))
    return [c for word in words for n, c in numbered if word == str(n) or c.startswith(word)]


def cards_in(listing: str) -> list[str]:
    """The UUIDs of the cards in what `nvidia-smi -L` prints."""
    return _CARD.findall(listing)


def _cards() -> list[str]:
    if told := setting("gpu", "cards"):
        return told.replace(",", " ").split()
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        command = ["nvidia-smi", "-L"]
        run = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        return cards_in(run.stdout)
    return []


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
