"""The folder in which the toys note that they were built."""

from pathlib import Path

import pytest

from pipeline.settings import current_store
from pipeline.store import Store


@pytest.fixture(autouse=True)
def toys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the toys' marks."""
    folder = tmp_path / "toys"
    folder.mkdir()
    monkeypatch.setenv("STYLETRF_TOYS", str(folder))
    return folder


@pytest.fixture
def store() -> Store:
    """The test's empty store."""
    return current_store()
