"""SHA-256 of bytes."""

import hashlib

from styletrf.errors import InputError


def sha256_of(content: bytes) -> str:
    """Returns the SHA-256 in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def require_sha256(
    subject: str,
    content: bytes,
    expected: str,
    remedy: str = "Nothing was kept; try again, or use another source",
) -> None:
    """Refuses bytes whose SHA-256 does not start with `expected`.

    Raises:
        InputError: They do not match; the error names both digests.
    """
    found = sha256_of(content)
    if not found.startswith(expected):
        problem = f"has SHA-256 {found}, where {expected} was expected"
        raise InputError(subject, problem, remedy)
