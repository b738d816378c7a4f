"""Signatures of files in a shared store, by a key of the machines that may write to it.

A signature is HMAC-SHA256 (RFC 2104) over the digest of typed parts. The signature of a record
covers all its canonical JSON with the digest of its object, so it covers every byte of the object.
"""

import hmac

from pipeline.digest import typed_digest
from pipeline.record import ActionRecord

SHORTEST_KEY = 32
"""The least number of bytes of a key."""
_MARK = b"\n\nhmac-sha256 "


class SignatureError(ValueError):
    """A file of a shared store is not signed by the key."""


def signature(key: bytes, kind: str, *parts: bytes) -> str:
    """Returns 64 hexadecimal digits that only a holder of the key can compute.

    Args:
        key: `SHORTEST_KEY` bytes or more.
        kind: The name space. A signature of one kind is not valid for another.
        parts: The signed bytes.
    """
    return hmac.new(key, typed_digest(kind, *parts).encode(), "sha256").hexdigest()


def is_signed(mark: str, key: bytes, kind: str, *parts: bytes) -> bool:
    """Whether `mark` is the signature; the time does not depend on how much of it is right."""
    return hmac.compare_digest(mark.encode(), signature(key, kind, *parts).encode())


def signed_text(record: ActionRecord, key: bytes) -> bytes:
    """Returns the text of a record in a shared store: JSON and, with a key, its signature."""
    text = record.to_json()
    return text + _MARK + signature(key, *_signed(record)).encode() + b"\n" if key else text


def from_signed_text(text: bytes, key: bytes) -> ActionRecord:
    """Reads the record that `signed_text` wrote; without a key, the signature does not matter.

    Raises:
        SignatureError: There is a key, and the key did not sign this record.
        ValueError: The text is not a record.
    """
    canonical, _, mark = text.partition(_MARK)
    record = ActionRecord.from_json(canonical)
    if key and not is_signed(mark.strip().decode("ascii", "replace"), key, *_signed(record)):
        raise SignatureError("unsigned" if not mark else "signed by another key, or altered")
    return record


def _signed(record: ActionRecord) -> tuple[str, bytes]:
    return "pipeline-signed-record-v1", record.to_json()
