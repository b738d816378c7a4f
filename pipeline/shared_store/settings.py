"""The settings of the shared store: where it is, how long to wait for it, and its signing key."""

import os

from pipeline.errors import StoreError
from pipeline.settings import configured_path, setting
from pipeline.shared_store.remote import Remote, open_remote
from pipeline.shared_store.signatures import SHORTEST_KEY

PATIENCE = "STYLETRF_PATIENCE"
"""The variable by which another machine gets the seconds to wait for the shared store."""


def current_remote() -> Remote:
    """The shared store in STYLETRF_REMOTE, or in [store] remote of `luigi.cfg`; or none."""
    url = os.environ.get("STYLETRF_REMOTE", setting("store", "remote"))
    patience_seconds = os.environ.get(PATIENCE, setting("store", "patience_seconds"))
    options = setting("store", "remote_options")
    return open_remote(url, options, float(patience_seconds), signing_key() if url else b"")


def signing_key() -> bytes:
    """The key in the file that [store] signing_key of `luigi.cfg` names; empty where none is named.

    Raises:
        StoreError: The file cannot be read, or holds too little.
    """
    if not setting("store", "signing_key"):
        return b""
    path = configured_path("store", "signing_key").expanduser()
    remedy = f"Make one for all machines: (umask 077; openssl rand -hex 32 > {path})"
    try:
        key = path.read_bytes().strip()
    except OSError as error:
        problem = f"[store] signing_key: {path} cannot be read ({error.strerror})"
        raise StoreError(f"{problem}. {remedy}.") from error
    if len(key) < SHORTEST_KEY:
        problem = f"[store] signing_key: {path} holds {len(key)} bytes, fewer than {SHORTEST_KEY}"
        raise StoreError(f"{problem}. {remedy}.")
    return key
