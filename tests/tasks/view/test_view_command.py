"""What the command refuses, and with which remedy."""

import unicodedata
from pathlib import Path

import pytest

from pipeline.settings import current_store
from tasks.view.view_command import parser, run

pytestmark = pytest.mark.usefixtures("out")


@pytest.fixture
def store() -> Path:
    return current_store().root


@pytest.mark.usefixtures("store")
def test_a_scene_without_results_is_refused_with_the_command_that_makes_them():
    with pytest.raises(SystemExit) as error:
        run(["mini", "--quality", "draft"])
    command = "luigi --module tasks StylizedTrajectory --scene mini --style p --quality draft"
    assert command in str(error.value)


@pytest.mark.parametrize("cause", [KeyboardInterrupt(), ValueError()])
def test_an_interrupt_in_a_compiled_function_ends_the_command_and_other_errors_do_not(
    cause, monkeypatch
):
    def interrupted(*_given: object) -> int:
        raise SystemError("returned a result with an exception set") from cause

    monkeypatch.setattr("tasks.view.view_command._serve", interrupted)
    if isinstance(cause, KeyboardInterrupt):
        assert run(["mini"]) == 0
    else:
        with pytest.raises(SystemError):
            run(["mini"])


@pytest.mark.usefixtures("store")
@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["nowhere"], "nowhere"),
        (["../mini"], "../mini"),
        (["mini", "--styles", '["p"]'], "--styles"),
        (["mini", "--path", "nowhere.json"], "nowhere.json"),
        (["mini", "--host", "203.0.113.7"], "203.0.113.7"),
        (["mini", "--port", "99999"], "99999"),
        (["mini", "--stylizer", "foo"], "--stylizer foo"),
        (["mini", "--RadianceField-settings", "{bad"], "{bad"),
    ],
)
def test_an_error_names_what_is_wrong(words: list[str], named: str):
    with pytest.raises(SystemExit) as error:
        run(words)
    assert named in str(error.value)


@pytest.mark.usefixtures("store")
@pytest.mark.parametrize("content", ["notes", '{"frames": []}', '{"key_frames": []}'])
def test_a_file_that_is_not_a_path_is_not_replaced(tmp_path: Path, content: str):
    file = tmp_path / "mine.json"
    file.write_text(content)
    with pytest.raises(SystemExit) as error:
        run(["mini", "--path-file", str(file)])
    assert str(file) in str(error.value)
    assert file.read_text() == content


def test_without_a_store_nothing_is_made(tmp_path: Path):
    with pytest.raises(SystemExit):
        run(["mini"])
    assert not (tmp_path / "store").exists()


def test_a_scene_is_one_scene_however_its_accents_are_typed():
    """The paths drawn in the page were saved in a folder of their own."""
    forms = (unicodedata.normalize(form, "caf\xe9") for form in ("NFC", "NFD"))
    assert [parser().parse_args([form]).scene for form in forms] == ["caf\xe9"] * 2
