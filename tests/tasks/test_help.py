"""The help of `styletrf` names every command, and needs no project folder."""

import subprocess
import sys
from pathlib import Path

import pytest
from message_words import mentions

import tasks
from tasks.__main__ import main

ROOT = Path(__file__).parents[2]


def answer(folder: Path, *words: str) -> tuple[int, str]:
    """Returns the status and the output of a command that runs in a folder."""
    command = [sys.executable, "-m", "tasks", *words]
    done = subprocess.run(
        command, cwd=folder, env={"PYTHONPATH": str(ROOT)}, capture_output=True, text=True
    )
    return done.returncode, done.stdout


def named_tasks(text: str) -> set[str]:
    """Returns the names in the list of tasks."""
    listed = text.partition("tasks:\n")[2].partition("\n\n")[0]
    return {line.split()[0] for line in listed.splitlines()}


def requested_tasks() -> set[str]:
    """Returns the names of the tasks that users request."""
    modules = {name: getattr(tasks, name).__module__ for name in tasks.__all__}
    return {name for name, module in modules.items() if module.startswith("tasks.results.")}


@pytest.mark.parametrize(
    ("words", "expected"), [(["--help"], 0), (["-h"], 0), (["help"], 0), ([], 2)]
)
def test_the_help_outside_a_project_folder_lists_the_commands(tmp_path, words, expected):
    status, text = answer(tmp_path, *words)
    assert status == expected
    assert "styletrf view" in text
    assert named_tasks(text) == requested_tasks()


def test_the_help_names_documents_that_exist():
    _, text = answer(ROOT, "--help")
    pages = [word.strip(".,") for word in text.split() if ".md" in word]
    assert pages
    assert [page for page in pages if not (ROOT / page).is_file()] == []


@pytest.mark.parametrize("name", sorted(tasks.__all__))
def test_the_help_of_a_parameter_needs_no_other_page(name):
    """It said "see ContentImages", whose help said nothing."""
    parameters = dict(getattr(tasks, name).get_params())
    described = {option: each.description or "" for option, each in parameters.items()}
    assert [option for option, text in described.items() if text.startswith("see ")] == []


@pytest.mark.parametrize("option", ["content", "perceptual", "transfer"])
def test_a_source_has_one_description_wherever_it_is_an_option(option):
    own = [dict(getattr(tasks, name).get_params()).get(option) for name in tasks.__all__]
    assert len({each.description for each in own if each}) == 1


@pytest.mark.parametrize("name", ["view", *sorted(requested_tasks())])
def test_command_without_one_of_its_letters_is_refused_with_its_name(name, monkeypatch):
    for place in range(len(name)):
        word = name[:place] + name[place + 1 :]
        monkeypatch.setattr(sys, "argv", ["styletrf", word, "horns"])
        with pytest.raises(SystemExit) as ended:
            main()
        assert mentions(str(ended.value), word, name)


def test_task_of_a_module_of_the_user_is_left_to_luigi(monkeypatch):
    monkeypatch.setattr("tasks.command_line.run", len)
    monkeypatch.setattr(sys, "argv", ["styletrf", "Grids", "--module", "mine"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 3
