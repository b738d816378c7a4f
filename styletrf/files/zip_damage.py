"""The exceptions that Python's `zipfile` raises for damaged archives."""

import lzma
import zipfile
import zlib

ZIP_DAMAGE = (
    OSError,
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    EOFError,
    RuntimeError,  # encrypted, or compressed in a way that is not known
    UnicodeDecodeError,  # names that are said to be UTF-8
)
