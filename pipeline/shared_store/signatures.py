"""Signatures of what lies in a shared store, by a key that those who may write to it hold.

A signature is HMAC-SHA256 (RFC 2104) over the digest of typed parts. A record's covers all that it
says in canonical form, the digest of its object included, so that no byte of the object can differ.
"""

import hmac

from pipeline.digest import typed_digest
from pipeline.record import ActionRecord

SHORTEST_KEY = 32
"""Bytes that a key has at least."""
_MARK = b"\n\nhmac-sha256 "


class SignatureError(ValueError):
    """What a shared store has is not signed by the key."""


def signature(key: bytes, kind: str, *parts: bytes) -> str:
    """Returns 64 hexadecimal digits that only a holder of the key can compute.

    Args:
        key: Of `SHORTEST_KEY` bytes or more.
        kind: The name space: what is signed as one kind is not signed as another.
        parts: What is signed.
    """
    return hmac.new(key, typed_digest(kind, *parts).encode(), "sha256").hexdigest()


def is_signed(mark: str, key: bytes, kind: str, *parts: bytes) -> bool:
    """Whether `mark` is the signature; takes as long however much of it is right."""
    return hmac.compare_digest(mark.encode(), signature(key, kind, *parts).encode())


def sealed(record: ActionRecord, key: bytes) -> bytes:
    """Returns a record as a shared store keeps it: with a key, its signature follows the JSON."""
    text = record.to_json()
    return text + _MARK + signature(key, *_signed(record)).encode() + b"\n" if key else text


def unsealed(text: bytes, key: bytes) -> ActionRecord:
    """Returns the record that `sealed` wrote; without a key, whether or not it is signed.

    Raises:
        SignatureError: There is a key, and it did not sign this.
        ValueError: It is no record at all.
    """
    canonical, _, mark = text.partition(_MARK)
    record = ActionRecord.from_json(canonical)
    if key and not is_signed(mark.strip().decode("ascii", "replace"), key, *_signed(record)):
        raise SignatureError("unsigned" if not mark else "signed by another key, or altered")
    return record


def _signed(record: ActionRecord) -> tuple[str, bytes]:
    return "pipeline-signed-record-v1", record.to_json()
