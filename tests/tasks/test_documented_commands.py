"""The commands of the documentation: a test parses or runs each, or a table says why none does."""

import re
import tomllib
from collections.abc import Sequence
from importlib.util import find_spec

import pytest
from documented_commands import (
    OF_THE_STORE,
    PROGRAMS,
    ROOT,
    Command,
    commands_not_run,
    documented_commands,
)
from luigi.cmdline_parser import CmdlineParser
from luigi.task_register import TaskClassException

import tasks
from pipeline.maintenance import command_line
from tasks.view import view_command

COMMANDS = list({str(command): command for command in documented_commands()}.values())
PARSED_HERE = {"luigi", "python -m pipeline", "styletrf view"}
RUN_BY = {
    "luigid": "tests/support/luigid_process.py",
    "python -m styletrf.style.export_style": "tests/styletrf/style/test_interchange.py",
    "python -m styletrf.synthetic.paintings": "tests/styletrf/synthetic/test_paintings.py",
    "python docs/examples/library.py": "tests/test_docs.py",
    "styletrf --help": "tests/tasks/test_help.py",
}
STAND_INS = {
    "$SCENES": ['["horns"]'],
    "$UNTIL": ["2026-11-23T06:00"],
    "$STYLES": ['["mosaic"]'],
    "$k/100": ["1/100"],
    "...": ["--scenes", '["horns"]', "--styles", '["mosaic"]'],
}


def of(subject: str) -> list[Command]:
    """Returns the commands of a subject that have arguments; others only name the program."""
    return [each for each in COMMANDS if each.subject == subject and each.arguments]


def parse_task(words: Sequence[str]) -> None:
    """Raises SystemExit or an error of Luigi if the task or a parameter does not exist."""
    filled = [part for word in words for part in STAND_INS.get(word, [word])]
    with CmdlineParser.global_instance(filled) as parser:
        parser.get_task_obj()


def test_every_page_has_commands_that_are_found() -> None:
    assert len(COMMANDS) > 40
    assert {command.words[0] for command in COMMANDS} <= set(PROGRAMS)


@pytest.mark.parametrize("command", of("luigi"), ids=str)
def test_a_task_of_luigi_and_its_parameters_exist(command: Command) -> None:
    parse_task(command.arguments)


@pytest.mark.parametrize("wrong", [["Grids"], ["SceneReport", "--scenes", "horns"]])
@pytest.mark.usefixtures("capfd")
def test_a_task_or_parameter_that_does_not_exist_is_noticed(wrong: list[str]) -> None:
    with pytest.raises((SystemExit, TaskClassException)):
        parse_task(["--module", "tasks", *wrong])


@pytest.mark.parametrize("command", of("python -m pipeline"), ids=str)
def test_a_command_of_the_store_and_its_options_exist(command: Command) -> None:
    words = [word.strip("[]") for word in command.arguments]
    given = command_line.parser().parse_args(words)
    if given.command == "why" and given.task[0] in tasks.__all__:
        parse_task(["--module", "tasks", *given.task])


def test_commands_of_the_store_are_known() -> None:
    for name in OF_THE_STORE:
        with pytest.raises(SystemExit) as ended:
            command_line.parser().parse_args([name, "--help"])
        assert ended.value.code == 0


@pytest.mark.parametrize("command", of("styletrf view"), ids=str)
def test_the_options_of_a_served_viewer_exist(command: Command) -> None:
    given, others = view_command.parser().parse_known_args(command.arguments)
    parse_task(["Viewer", "--scene", given.scene, "--styles", "[]", *others])


def test_extras_that_are_installed_exist() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = re.findall(r"\[(\w+)\]", " ".join(map(str, of("pip install"))))
    assert named
    assert set(named) <= set(project["optional-dependencies"])


@pytest.mark.parametrize(("subject", "file"), RUN_BY.items())
def test_a_file_of_the_tests_runs_the_command(subject: str, file: str) -> None:
    assert subject.split()[-1] in (ROOT / file).read_text(encoding="utf-8")


def test_a_table_says_why_no_test_runs_the_others() -> None:
    others = {command.subject for command in COMMANDS} - PARSED_HERE - set(RUN_BY)
    not_run = commands_not_run()
    assert set(not_run) == others
    assert all(not_run.values())


@pytest.mark.parametrize("subject", commands_not_run())
def test_what_no_test_runs_exists(subject: str) -> None:
    program, *rest = subject.split()
    if program == "make":
        assert re.search(rf"^{rest[0]}:", (ROOT / "Makefile").read_text(), re.MULTILINE)
    elif rest[:1] == ["-m"]:
        assert find_spec(rest[1])
    elif program in ("python", ".ci/run"):
        assert (ROOT / (rest or [program])[0]).is_file()
