"""Bytes as text in a page of UTF-16, two bytes to a letter.

HTML changes some letters (zero, carriage returns), and reads others as markup or not at all. These
are written as ESCAPE and the letter with its highest bit flipped. So text is 3.7 % longer than
random bytes, where base64 adds a third. `unpacking.js` undoes it.
"""

import numpy as np
from jaxtyping import Bool, UInt16

ESCAPE = 0xE000
_FLIPPED = 0x8000
_CONTROL = 0x40  # letters below: controls, and "<" and "&"
_SURROGATE = 0xD800  # letters from here to ESCAPE are halves of others
_NO_LETTER = 0xFFFE


def block_text(data: bytes) -> str:
    """Returns bytes as text; its first letter is the number of bytes in its last one, 1 or 2."""
    n_last = 2 - len(data) % 2
    letters = np.frombuffer(data + bytes(2 - n_last), "<u2")
    is_escaped = _is_escaped(letters)
    text = np.full(len(letters) + int(is_escaped.sum()), ESCAPE, "<u2")
    text[np.cumsum(1 + is_escaped) - 1] = np.where(is_escaped, letters ^ _FLIPPED, letters)
    return f"{n_last}{text.tobytes().decode('utf-16-le')}"


def _is_escaped(letters: UInt16[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    is_special = (letters < _CONTROL) | (letters >= _NO_LETTER)
    return is_special | ((letters >= _SURROGATE) & (letters <= ESCAPE))
