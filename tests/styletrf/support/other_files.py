"""Files that are no weights, over which torch's unpickler trips, each in another way."""

OTHER_FILES = (
    b"",
    b"not weights",
    b"Rate limit exceeded",
    b"404: Not Found",
    b"<!DOCTYPE html><html></html>",
    b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 5\n",
    b"GIF89a" + bytes(40),
    b"\x89PNG\r\n\x1a\n" + bytes(20),
    b"\xff\xd8\xff\xe0 a JPEG",
    b"PK\x05\x06" + bytes(18),
    b"\x80\x02}q\x01.",
)
