"""What Python's `zipfile` raises of archives that are not whole."""

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
