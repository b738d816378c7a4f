"""Where settings are found, and what relative paths in them start from."""

import os
from pathlib import Path

import pytest

import pipeline
from pipeline.code.snapshot import identity_file
from pipeline.settings import current_store, data_root, out_root


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A configuration file in a folder of its own, and a working directory without one."""
    for variable in ("STYLETRF_STORE", "STYLETRF_DATA", "STYLETRF_OUT"):
        monkeypatch.delenv(variable, raising=False)
    folder = tmp_path / "cluster"
    folder.mkdir()
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setenv("LUIGI_CONFIG_PATH", str(folder / "cluster.cfg"))
    return folder


def test_a_relative_path_starts_where_the_file_lies_that_names_it(elsewhere, tmp_path):
    (elsewhere / "cluster.cfg").write_text("[out]\nroot = out\n")
    assert out_root() == elsewhere / "out"
    assert data_root() == tmp_path / "work" / "data", "a default starts at the working directory"


def test_the_snapshot_lies_by_the_code_wherever_a_command_runs(elsewhere):
    """Else the same code had other keys in another folder."""
    assert identity_file() == Path(pipeline.__file__).parents[1] / "tasks/identity.json"


def test_a_variable_starts_at_the_working_directory(elsewhere, tmp_path, monkeypatch):
    (elsewhere / "cluster.cfg").write_text("[store]\nroot = mine\n")
    monkeypatch.setenv("STYLETRF_STORE", "theirs")
    assert current_store().root == tmp_path / "work" / "theirs"
    assert os.listdir(tmp_path / "work") == ["theirs"]  # noqa: PTH208
