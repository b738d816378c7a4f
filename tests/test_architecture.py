"""docs/architecture.md names files that exist, and tests share helpers in `support/` alone."""

import ast
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from source_names import modules_imported, names_of, syntax_of

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
PACKAGES = ("styletrf", "tasks", "pipeline")
FILE = re.compile(r"`((?:styletrf|tasks|pipeline)/[\w/]*(?:\.py)?)`")


def test_every_file_that_the_page_of_the_architecture_names_exists():
    named = FILE.findall(TEXT)
    assert len(named) > 30
    assert [path for path in named if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("row", [line for line in TEXT.splitlines() if line.startswith("| W")])
def test_every_name_in_an_answer_stands_in_a_file_of_that_answer(row: str):
    answer = row.split("|")[2]
    files = [ROOT / path for path in FILE.findall(answer) if path.endswith(".py")]
    names = set(re.findall(r"`(\w+)`", answer))
    assert names - set().union(*map(names_of, files)) == set()


@pytest.mark.parametrize("package", ["styletrf", "tasks"])
def test_the_layers_it_draws_are_those_that_are_checked(package: str):
    (layers,) = (
        each["layers"]
        for each in _contracts()
        if each["type"] == "layers" and each.get("containers") == [package]
    )
    blocks = re.findall(r"^```\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)
    assert layers in [[re.split(" {2,}", line)[0] for line in b.splitlines()] for b in blocks]


@pytest.mark.parametrize("package", PACKAGES)
def test_the_sizes_it_states_are_those_of_the_source_within_a_twentieth(package: str):
    (row,) = re.findall(rf"^\| `{package}/`: files, lines .*\| (.+), (.+) \|$", TEXT, re.MULTILINE)
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / package).rglob("*.py")]
    counts = len(texts), sum(len(text.splitlines()) for text in texts)
    assert [int(number.replace(",", "")) for number in row] == pytest.approx(counts, rel=0.05)


def test_the_names_of_a_thing_are_as_many_as_it_states_and_in_the_source():
    files = (path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    known = set(re.findall(r"\w+", " ".join(path.read_text(encoding="utf-8") for path in files)))
    rows = re.findall(r"^\| .+ \| (\d): (.+) \| (\d): (.+) \|$", TEXT, re.MULTILINE)
    assert len(rows) >= 6
    for before, former, after, present in rows:
        names = re.findall(r"`(\w+)`", present)
        assert [former.count("`"), 2 * len(names)] == [2 * int(before), 2 * int(after)]
        assert known.issuperset(names)


def test_a_package_has_at_most_sixteen_files():
    modules = [path for name in PACKAGES for path in (ROOT / name).rglob("*.py")]
    sizes = Counter(path.parent for path in modules if path.name != "__init__.py")
    assert {folder: size for folder, size in sizes.items() if size > 16} == {}


@pytest.mark.parametrize("name", PACKAGES)
def test_every_package_says_in_sentences_where_to_begin(name: str):
    for file in (ROOT / name).rglob("__init__.py"):
        text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
        assert len(re.findall(r"[.:](?=\s|$)", text)) >= 2, file
        own = {path.stem for path in file.parent.iterdir()}
        assert own & {each.split(".")[0] for each in re.findall(r"`([\w.]+)`", text)}, file


def test_the_core_of_the_pipeline_can_be_read_in_an_hour():
    (core,) = (
        set(each["source_modules"]) for each in _contracts() if each["name"].startswith("the core ")
    )
    others = ("command", "parameters", "task", "__main__")
    outside = {f"pipeline.{name}" for name in others}
    files = {f"pipeline.{path.stem}": path for path in (ROOT / "pipeline").glob("*.py")}
    assert files.keys() - outside - {"pipeline.__init__"} == core
    lines = sum(len(files[name].read_text(encoding="utf-8").splitlines()) for name in core)
    assert lines <= 1600


def _contracts() -> list[dict]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return project["tool"]["importlinter"]["contracts"]


def test_tests_import_nothing_of_other_tests():
    """Else they run twice, and what they share is hard to find."""
    for path in (ROOT / "tests").rglob("*.py"):
        modules = modules_imported(ast.walk(syntax_of(path)))
        assert [m for m in modules if m.rpartition(".")[2].startswith("test_")] == [], path


def test_programs_beside_the_tests_find_what_they_import():
    folder = ROOT / "tests/support"
    files = [f"{folder}/{name}.py" for name in ("small_grids", "grid_requests", "faulty_grids")]
    begun = [f"runpy.run_path({file!r}, run_name='imported')" for file in files]
    code = "; ".join(["import runpy, sys", f"sys.path[0] = {str(folder)!r}", *begun])
    subprocess.run([sys.executable, "-c", code], check=True, cwd=folder)


def test_functions_of_tasks_import_only_what_is_slow_to_load():
    """A command that plans or finds artifacts loads neither torch nor OpenCV: see architecture.md.

    The number may fall, but a new import inside a function needs a good reason.
    """
    found = [name for path in (ROOT / "tasks").rglob("*.py") for name in _inner_imports(path)]
    contents = ("tasks.summary.report_content", "tasks.summary.trade_off_content")
    slow = ("styletrf.", "torch", *contents)
    assert [name for name in found if not name.startswith(slow)] == []
    assert len(found) <= 40


def _inner_imports(path: Path) -> Iterator[str]:
    """Yields the modules that the functions of a file import."""
    functions = (ast.FunctionDef, ast.AsyncFunctionDef)
    outer = (f for f in ast.walk(syntax_of(path)) if isinstance(f, functions))
    yield from modules_imported({node for f in outer for node in ast.walk(f)})
