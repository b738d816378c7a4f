"""Small facts that a machine remembers beside the artifacts of its store, in files of JSON.

They decide no artifact, but `choices` decides which settings the next command builds with. A file
that is damaged counts as empty, and one that cannot be written stays as it is.
"""

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from pipeline.settings import current_store
from styletrf.files.atomic_write import atomic_write


def read_facts(name: str) -> dict[str, Any]:
    """Returns the content of the file `name` of the store; empty if it cannot be read."""
    with suppress(OSError, ValueError):
        content = json.loads(facts_file(name).read_text())
        return content if isinstance(content, dict) else {}
    return {}


def add_fact(name: str, key: str, value: Any) -> None:
    """Adds a value to the file; others see the file as it was or as it is, never a part.

    The workers of a command may add values at the same time, so each waits for the others.
    """
    with suppress(OSError), current_store().lock(name, on_wait=lambda: None):
        known = {**read_facts(name), key: value}
        with atomic_write(facts_file(name)) as partial:
            partial.write_text(json.dumps(known, indent=1, sort_keys=True))


def facts_file(name: str) -> Path:
    """Returns where the file lies."""
    return current_store().root / f"{name}.json"
