"""Which files, numbers, options and choices a message names, whatever its sentences are."""

import re
from pathlib import Path


def mentions(text: str, *things: object) -> bool:
    """Whether a text has all the things, none as a part of a longer name, number or path."""
    return all(_has(text, thing) for thing in things)


def _has(text: str, thing: object) -> bool:
    word = str(thing)
    assert word, "nothing is in any text"
    longer = r"[\w/-]|\.\w" if isinstance(thing, Path) else r"[\w-]|\.\w"
    return bool(re.search(rf"(?<![\w.-]){re.escape(word)}(?!{longer})", text))
