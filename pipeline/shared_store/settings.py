"""The settings of the shared store: where it is, how long to wait for it, and its signing key."""

import contextlib
import json
import os

from pipeline.errors import StoreError
from pipeline.settings import (
    configured_path,
    invalid_setting,
    nonnegative_number,
    number_setting,
    setting,
)
from pipeline.shared_store.remote import Remote, open_remote
from pipeline.shared_store.signatures import SHORTEST_KEY

PATIENCE = "STYLETRF_PATIENCE"
"""The variable that sets, on another machine, how long to wait for the shared store."""


def current_remote() -> Remote:
    """Returns the shared store in STYLETRF_REMOTE or [store] remote, if there is one.

    If STYLETRF_REMOTE is empty, there is none, whatever [store] remote is.

    Raises:
        StoreError: A setting of the shared store is invalid.
    """
    url = os.environ.get("STYLETRF_REMOTE", _configured_url())
    options = setting("store", "remote_options")
    if not _is_object(options):
        raise invalid_setting("store", "remote_options", 'a JSON object, such as {"anon": true}')
    return open_remote(url, options, _patience_seconds(), signing_key() if url else b"")


def _configured_url() -> str:
    """Returns [store] remote; a relative path starts at the folder of the file that has it."""
    url = setting("store", "remote")
    return url if not url or "://" in url else str(configured_path("store", "remote"))


def _is_object(text: str) -> bool:
    """Returns whether a text is a JSON object."""
    with contextlib.suppress(ValueError):
        return isinstance(json.loads(text), dict)
    return False


def _patience_seconds() -> float:
    given = os.environ.get(PATIENCE)
    if not given:
        return number_setting("store", "patience_seconds")
    seconds = nonnegative_number(given)
    if seconds is None:
        remedy = "Correct it, or unset it for the default"
        raise StoreError(f"{PATIENCE} = {given} is not a number of seconds of 0 or more. {remedy}.")
    return seconds


def signing_key() -> bytes:
    """Reads the key in the file that [store] signing_key names; empty if none is named.

    Raises:
        StoreError: The file cannot be read, or is too short.
    """
    if not setting("store", "signing_key"):
        return b""
    path = configured_path("store", "signing_key")
    remedy = f"Make one key for all machines: (umask 077; openssl rand -hex 32 > {path})"
    try:
        key = path.read_bytes().strip()
    except OSError as error:
        problem = f"[store] signing_key: {path} cannot be read ({error.strerror})"
        raise StoreError(f"{problem}. {remedy}.") from error
    if len(key) < SHORTEST_KEY:
        problem = f"[store] signing_key: {path} has {len(key)} bytes, fewer than {SHORTEST_KEY}"
        raise StoreError(f"{problem}. {remedy}.")
    return key
