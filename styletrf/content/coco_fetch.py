"""Content photographs fetched one by one, from the addresses in a COCO annotations file.

Fetched files stay in a folder of the user's, so that an interrupted fetch continues where it ended.
"""

import json
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from functools import partial
from http.client import HTTPException
from pathlib import Path
from urllib.parse import quote, urlsplit, urlunsplit

from styletrf.content.content_sources import ContentSource, decoded_image
from styletrf.errors import InputError, NetworkError
from styletrf.files.atomic_write import atomic_write

_ATTEMPTS = 4
MOST_MISSING = 32
"""Images in a row that a server may not have before the server or the network is at fault."""
_TIMEOUT_S = 30.0
_FIRST_PAUSE_S = 1.0  # doubled after every failure
LARGEST_BYTES = 64 * 2**20
"""Of one image; the largest photographs of COCO have less than one MiB."""
_CHUNK_BYTES = 1 << 16
_SAFE = "/%:@!$&'()*+,;=~?"  # in the path and the query of an address; escapes stay

_REMEDY = (
    "Check the network and run again: what was fetched is kept. Offline, give a folder or a zip of "
    "photographs"
)


def coco_source(
    annotations: Path, cache: Path, *, pause: Callable[[float], None] = time.sleep
) -> ContentSource:
    """Returns the images of an `instances_*.json`, fetched from their `coco_url` when read.

    Reading an image looks for `cache/FILE_NAME` first and leaves it there, whole and decodable, or
    not at all. It tries four times, waiting 1, 2 and 4 seconds between. An image that the server
    does not have, or that does not decode, reads as empty bytes, unless `MOST_MISSING` do in a row.

    Args:
        annotations: The JSON file; of it only `images` with `file_name` and `coco_url` is used.
        cache: An existing folder.
        pause: How to wait.

    Raises:
        InputError: The file is not a JSON of this kind, or has a name or an address that is not
            plain.
        NetworkError: While reading: the network or the server fails.
        InputError: While reading: an image is larger than `LARGEST_BYTES`, so that its rest is not
            fetched.
    """
    try:
        entries = json.loads(annotations.read_text(encoding="utf-8"))["images"]
        addresses = {str(entry["file_name"]): str(entry["coco_url"]) for entry in entries}
    except (OSError, ValueError, KeyError, TypeError) as error:
        problem = f"is no COCO annotations file ({type(error).__name__}: {error})"
        remedy = "Give an instances_*.json, whose `images` have a `file_name` and a `coco_url`"
        raise InputError(str(annotations), problem, remedy) from error
    for name, address in addresses.items():
        try:
            addresses[name] = _web_address(address)
            is_plain = Path(name).name == name
        except ValueError:
            is_plain = False
        if not is_plain:
            problem = f"the image {name!r} has a path or address that is refused ({address})"
            raise InputError(str(annotations), problem, "Give plain file names and web addresses")
    read = partial(_read, addresses, cache, pause, list[str]())
    return ContentSource(str(annotations), tuple(sorted(addresses)), read)


def _web_address(text: str) -> str:
    """Returns an address in ASCII, with the characters escaped that an address must not contain.

    Raises:
        ValueError: It is no address of the web.
    """
    parts = urlsplit(text)
    if parts.scheme not in {"http", "https"} or not parts.hostname or " " in parts.netloc:
        raise ValueError(text)
    if parts.port == 0:  # one that is no number or too large is refused by itself
        raise ValueError(text)
    host = parts.netloc.encode("idna").decode()
    path, query = quote(parts.path, _SAFE), quote(parts.query, _SAFE)
    return urlunsplit((parts.scheme, host, path, query, ""))


def _read(
    addresses: dict[str, str],
    cache: Path,
    pause: Callable[[float], None],
    missing: list[str],
    name: str,
) -> bytes:
    """Returns an image; `missing` has the reasons of those in a row that the server has not."""
    path = cache / name
    if path.exists() and decoded_image(path.read_bytes()) is not None:
        missing.clear()
        return path.read_bytes()
    content, problem = _fetch(addresses[name], pause)
    if content:
        missing.clear()
        _keep(content, path)
        return content
    missing.append(problem)
    if len(missing) >= MOST_MISSING:
        problem = f"{MOST_MISSING} images in a row, or more, are missing ({problem})"
        raise NetworkError(addresses[name], problem, _REMEDY)
    return b""


def _keep(content: bytes, path: Path) -> None:
    """Writes a fetched image into the cache.

    Raises:
        InputError: It cannot be written, so that no other image can.
    """
    try:
        with atomic_write(path) as partial_path:
            partial_path.write_bytes(content)
    except OSError as error:
        problem = f"cannot be written ({error.strerror})"
        raise InputError(str(path), problem, "Free some space, or make it writable") from error


def _fetch(address: str, pause: Callable[[float], None]) -> tuple[bytes, str]:
    """Returns the decodable image at an address; empty bytes and why where the server has none."""
    problem, damaged = "", False
    for attempt in range(_ATTEMPTS):
        if attempt:
            pause(_FIRST_PAUSE_S * 2 ** (attempt - 1))
        try:
            content = _download(address)
        except urllib.error.HTTPError as error:
            if error.code in {403, 404, 410}:
                return b"", str(error)
            problem, damaged = str(error), False
        except (OSError, HTTPException) as error:
            problem, damaged = f"{type(error).__name__}: {error}", False
        else:
            if decoded_image(content) is not None:
                return content, ""
            damaged = True
    if damaged:
        return b"", "what the server sends is no image"
    raise NetworkError(
        address, f"cannot be fetched after {_ATTEMPTS} attempts ({problem})", _REMEDY
    )


def _download(address: str) -> bytes:
    """Returns the bytes at an address; reads no more of them than an image may have."""
    content = bytearray()
    with urllib.request.urlopen(address, timeout=_TIMEOUT_S) as response:  # noqa: S310 only http(s)
        while chunk := response.read(_CHUNK_BYTES):
            content += chunk
            if len(content) > LARGEST_BYTES:
                problem = f"has more than {LARGEST_BYTES / 2**20:g} MiB, too much for a photograph"
                remedy = "Check the address, or take the image out of the annotations"
                raise InputError(address, problem, remedy)
    return bytes(content)
