"""Where settings are found, and what relative paths in them start from."""

import os
import re
import traceback
from pathlib import Path

import pytest
from luigi.configuration import LuigiConfigParser
from message_words import mentions

import pipeline
from pipeline.code.snapshot import identity_file
from pipeline.errors import StoreError
from pipeline.settings import (
    boolean_setting,
    current_store,
    data_root,
    number_setting,
    out_root,
    setting,
)
from pipeline.shared_store.settings import PATIENCE, current_remote


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


def test_a_home_that_there_is_not_is_one_line_of_its_setting(write):
    """It was a traceback."""
    write("[out]\nroot = ~nobody-has-this-name/out\n")
    with pytest.raises(StoreError) as error:
        out_root()
    assert mentions(str(error.value), "[out] root", "~nobody-has-this-name/out", "a path")


@pytest.mark.parametrize(
    ("given", "found"),
    [("shared", "cluster/shared"), ("", ""), ("s3://bucket/a", "s3://bucket/a"), ("/mnt", "/mnt")],
)
def test_a_shared_store_in_a_folder_starts_there_too(write, tmp_path, monkeypatch, given, found):
    """It started at the working directory, and builds went on without it."""
    monkeypatch.delenv("STYLETRF_REMOTE", raising=False)
    write(f"[store]\nremote = {given}\n")
    expected = str(tmp_path / found) if found == "cluster/shared" else found
    assert current_remote().url == expected


@pytest.mark.parametrize("given", ["", "elsewhere"])
def test_a_variable_wins_over_the_setting_even_if_it_is_empty(write, monkeypatch, given):
    write("[store]\nremote = shared\n")
    monkeypatch.setenv("STYLETRF_REMOTE", given)
    assert current_remote().url == given


def test_no_file_for_deployment_sets_an_empty_shared_store():
    """It would switch off the one of the settings."""
    deploy = Path(__file__).parents[2] / "deploy"
    (worker,) = re.findall(r"^ *STYLETRF_REMOTE:(.*)$", (deploy / "compose.yaml").read_text(), re.M)
    assert not worker, "the variable of the command, if there is one"
    assert not re.findall(r"^STYLETRF_REMOTE=\s*$", (deploy / "styletrf.env").read_text(), re.M)


@pytest.mark.parametrize(
    ("section", "name", "value"),
    [
        ("grid", "webhook", "https://example.org/a%2Fsecret"),
        ("store", "remote", "s3://bucket/%(secret)s"),
        ("store", "root", "/mnt/${NO_SUCH_secret}"),
    ],
)
def test_a_setting_that_cannot_be_read_is_an_error_without_its_value(
    write, elsewhere, section, name, value
):
    """An address of a webhook is a secret."""
    write(f"[{section}]\n{name} = {value}\n")
    with pytest.raises(StoreError) as error:
        setting(section, name)
    trace = "".join(traceback.format_exception(error.value))
    assert mentions(trace, f"[{section}] {name}", elsewhere / "cluster.cfg", "%%")
    assert "secret" not in trace
    write(f"[{section}]\n{name} = a%%2F\n")
    assert setting(section, name) == "a%2F"


@pytest.mark.parametrize("place", [data_root, out_root])
def test_a_path_may_start_at_the_home_folder(write, tmp_path, monkeypatch, place):
    """It made a folder of the name `~`."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    write("[data]\nroot = ~/mine\n[out]\nroot = ~/mine\n")
    assert place() == tmp_path / "home" / "mine"


def test_options_that_are_no_object_are_an_error_with_their_file(write, elsewhere):
    """The error blamed the address of the shared store."""
    write("[store]\nremote_options = {bad\n")
    with pytest.raises(StoreError) as error:
        current_remote()
    assert mentions(str(error.value), "[store] remote_options = {bad", elsewhere / "cluster.cfg")


def test_the_snapshot_lies_by_the_code_wherever_a_command_runs(elsewhere):
    """Else the same code had other keys in another folder."""
    assert identity_file() == Path(pipeline.__file__).parents[1] / "tasks/identity.json"


def test_a_variable_starts_at_the_working_directory(elsewhere, tmp_path, monkeypatch):
    (elsewhere / "cluster.cfg").write_text("[store]\nroot = mine\n")
    monkeypatch.setenv("STYLETRF_STORE", "theirs")
    assert current_store().root == tmp_path / "work" / "theirs"
    assert os.listdir(tmp_path / "work") == ["theirs"]  # noqa: PTH208


@pytest.fixture
def write(elsewhere, monkeypatch):
    """Writes the configuration file, which Luigi then reads again."""

    def written(text: str) -> None:
        (elsewhere / "cluster.cfg").write_text(text)
        monkeypatch.setattr(LuigiConfigParser, "_config_paths", [elsewhere / "cluster.cfg"])
        monkeypatch.setattr(LuigiConfigParser, "_instance", None)

    return written


@pytest.mark.parametrize("word", ["true", "True", "YES", "on", "1", "false", "No", "0"])
def test_a_boolean_is_any_word_that_configparser_knows(write, word):
    """`push = True` meant false."""
    write(f"[store]\npush = {word}\n")
    is_true = word in ("true", "True", "YES", "on", "1")
    assert boolean_setting("store", "push") is is_true


@pytest.mark.parametrize("word", ["lots", "-1", "nan", "inf", ""])
def test_a_number_that_is_none_is_an_error_with_its_file(write, elsewhere, word):
    write(f"[store]\nretry_seconds = {word}\n")
    with pytest.raises(StoreError) as error:
        number_setting("store", "retry_seconds")
    assert mentions(str(error.value), f"[store] retry_seconds = {word}", elsewhere / "cluster.cfg")
    assert number_setting("store", "checkpoint_seconds") == 60


@pytest.mark.parametrize("word", ["long", "-1", "nan", "inf"])
def test_a_patience_that_is_no_number_is_an_error_with_its_variable(monkeypatch, word):
    """It was a trace of `float`."""
    monkeypatch.setenv(PATIENCE, word)
    with pytest.raises(StoreError) as error:
        current_remote()
    assert mentions(str(error.value), f"{PATIENCE} = {word}")


def test_a_boolean_that_is_none_is_an_error_with_its_file(write, elsewhere):
    write("[store]\nlocks = maybe\n")
    with pytest.raises(StoreError) as error:
        boolean_setting("store", "locks")
    assert mentions(str(error.value), "[store] locks = maybe", elsewhere / "cluster.cfg")
