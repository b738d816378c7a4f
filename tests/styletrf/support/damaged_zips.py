"""Zips whose first member cannot be read, each in another way."""

import zipfile
from pathlib import Path

FAULTS = ("cut up", "encrypted", "packed in an unknown way")


def spoil_first_member(path: Path, fault: str) -> None:
    """Breaks the deflated data of a zip's first member, or what is said of it."""
    with zipfile.ZipFile(path) as archive:
        first, directory = archive.infolist()[0], archive.start_dir
    content = bytearray(path.read_bytes())
    if fault == "cut up":
        data = first.header_offset + 30 + len(first.filename)
        content[data : data + first.compress_size] = b"\xff" * first.compress_size
    elif fault == "encrypted":
        content[first.header_offset + 6] |= 1
        content[directory + 8] |= 1
    else:
        content[first.header_offset + 8] = content[directory + 10] = 99
    path.write_bytes(content)
