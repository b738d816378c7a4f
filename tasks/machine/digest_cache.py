"""Digests of the user's large files, remembered: a COCO zip is read once, not by every command."""

import json
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from pipeline.digest import file_digest
from pipeline.settings import current_store
from styletrf.files.atomic_write import atomic_write

_TICK_S = 2.0  # of the coarsest clock of a file system: what changes twice within it looks the same


def cached_digests(files: Mapping[str, Path]) -> dict[str, str]:
    """Returns the digest of each file by its name; reads those that changed since the last time.

    A file is taken for the same while its path, size, time of change and inode are. The memory is
    `digests.json` in the store; without it, or where it cannot be written, files are read again.
    """
    memory = current_store().root / "digests.json"
    known, digests = _recalled(memory), {}
    before = dict(known)
    for name, path in files.items():
        status, place = path.stat(), str(path.absolute())
        stamp = [status.st_size, status.st_mtime_ns, status.st_ino]
        if (found := known.get(place)) is None or found[:-1] != stamp:
            found = known[place] = [*stamp, file_digest(path)]
        if time.time() - status.st_mtime < _TICK_S:
            del known[place]
        digests[name] = str(found[-1])
    if known != before:
        with suppress(OSError), atomic_write(memory) as partial:
            partial.write_text(json.dumps(known, indent=0, sort_keys=True))
    return digests


def _recalled(memory: Path) -> dict[str, list[int | str]]:
    with suppress(OSError, ValueError):
        content = json.loads(memory.read_text())
        if isinstance(content, dict) and all(isinstance(row, list) for row in content.values()):
            return content
    return {}
