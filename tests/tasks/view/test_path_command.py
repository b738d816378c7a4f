"""The command renders what the page shows."""

import shlex
from pathlib import Path

import pytest

import tasks
from tasks.view.path_command import path_command

FILE = Path("/somewhere/a path.json")


@pytest.mark.parametrize(
    ("weights", "words"),
    [
        ({"p": 1.0}, {"style": "p", "strength": 1.0, "blend": {}}),
        ({"p": 0.25}, {"style": "p", "strength": 0.25, "blend": {}}),
        ({}, {"style": "first", "strength": 0.0, "blend": {}}),
        ({"p": 0.6, "q": 0.4}, {"style": "p", "strength": 1.0, "blend": {"q": 0.4}}),
    ],
)
def test_the_command_is_read_as_it_was_shown(weights, words):
    command = shlex.split(path_command(FILE, 2.5, weights, ["--scene", "mini"], "first"))
    assert command[:4] == ["luigi", "--module", "tasks", "StylizedTrajectory"]
    from luigi.cmdline_parser import CmdlineParser

    with CmdlineParser.global_instance(command[3:]) as parser:
        task = parser.get_task_obj()
    assert isinstance(task, tasks.StylizedTrajectory)
    assert (task.scene, task.path, task.seconds) == ("mini", str(FILE), 2.5)
    assert {name: getattr(task, name) for name in words} == words
