"""Bytes as text of a page: what the browser does is done here in Python."""

import numpy as np
import pytest

from styletrf.viewer.webpage.block_text import ESCAPE, block_text

EVERY_LETTER = np.arange(2**16, dtype="<u2").tobytes()
CASES = [b"", b"\0", b"\r\n", b"<\0/\0s\0", bytes(range(256)), EVERY_LETTER, EVERY_LETTER[1:]]


def unpacked(text: str) -> bytes:
    """Returns what `bytesOfText` in unpacking.js does."""
    units = np.frombuffer(text.encode("utf-16-le"), "<u2")
    letters, escaped = [], False
    for letter in units[1:].tolist():
        if letter == ESCAPE and not escaped:
            escaped = True
            continue
        letters.append(letter ^ 0x8000 if escaped else letter)
        escaped = False
    return np.array(letters, "<u2").tobytes()[: 2 * (len(letters) - 1) + int(text[0])]


@pytest.mark.parametrize("data", CASES, ids=len)
def test_bytes_come_back_from_their_text(data: bytes):
    assert unpacked(block_text(data)) == data


def test_no_letter_is_markup_or_one_that_browsers_change():
    letters = {ord(letter) for letter in block_text(EVERY_LETTER)[1:]}
    assert min(letters) >= 0x40
    assert not any(0xD800 <= letter < 0xE000 or letter >= 0xFFFE for letter in letters)


def test_random_bytes_need_a_tenth_more_space_at_most():
    data = np.random.default_rng(0).bytes(100_000)
    assert len(block_text(data).encode("utf-16-le")) < 1.1 * len(data)
