"""Compiled code follows all that it was compiled from, and is kept where nothing changed."""

import ast
import os
import subprocess
import sys
import time
from pathlib import Path

import numba
import pytest

from styletrf.compiled import KEPT_FOLDERS, compiled, folder_of_code

ROOT = Path(__file__).parents[2]
PACKAGE = {
    "__init__.py": "",
    "inner.py": """
from styletrf.compiled import compiled
SCALE = 2.0
@compiled(inline="always")
def scaled(x):
    return SCALE * x
""",
    "outer.py": """
from styletrf.compiled import compiled
from toy.inner import scaled
@compiled()
def outer(x):
    return scaled(x) + 1.0
print(outer(3.0), sum(outer.stats.cache_misses.values()))
""",
}


@pytest.fixture
def toy(tmp_path: Path) -> Path:
    """A package of two files, the one compiled into the other."""
    (tmp_path / "toy").mkdir()
    for name, text in PACKAGE.items():
        (tmp_path / "toy" / name).write_text(text)
    return tmp_path / "toy"


def run(toy: Path, **variables: str) -> list[float]:
    """The result of the outer function in a fresh process, and how often it had to compile."""
    path = os.pathsep.join([str(toy.parent), str(ROOT)])
    environment = {**os.environ, "PYTHONPATH": path, **variables}
    words = [sys.executable, "-m", "toy.outer"]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    return [float(word) for word in done.stdout.split()]


def test_a_constant_of_another_file_counts_with_a_warm_cache(toy: Path):
    assert run(toy) == [7, 1]
    assert run(toy) == [7, 0], "what did not change is not compiled again"
    inner = toy / "inner.py"
    inner.write_text(inner.read_text().replace("SCALE = 2.0", "SCALE = 5.0"))
    assert run(toy) == [16, 1]
    inner.write_text(inner.read_text().replace("SCALE = 5.0", "SCALE = 2.0"))
    assert run(toy) == [7, 0], "the folder of the former files is still there"


def test_a_folder_that_the_user_names_is_no_way_around(toy: Path, tmp_path: Path):
    variables = {"NUMBA_CACHE_DIR": str(tmp_path / "named")}
    assert run(toy, **variables) == [7, 1]
    inner = toy / "inner.py"
    inner.write_text(inner.read_text().replace("SCALE = 2.0", "SCALE = 5.0"))
    assert run(toy, **variables) == [16, 1]
    assert len(list((tmp_path / "named").glob("styletrf-toy-*"))) == 2


def test_old_folders_go_and_the_newest_stay(toy: Path):
    folders = []
    for k in range(KEPT_FOLDERS + 3):
        (toy / "inner.py").write_text(f"SCALE = {k}.0\n")
        folder_of_code.cache_clear()
        folders.append(folder_of_code(toy))
        os.utime(folders[-1], (k, k))
    now = time.time()
    os.utime(folders[3], (now, now))  # used again
    (toy / "inner.py").write_text("SCALE = 100.0\n")
    folder_of_code.cache_clear()
    newest = folder_of_code(toy)
    folder_of_code.cache_clear()
    kept = set(newest.parent.glob("styletrf-toy-*"))
    assert len(kept) == KEPT_FOLDERS
    assert {newest, folders[3], folders[-1]} <= kept
    assert not folders[0].exists()


def test_a_package_that_cannot_be_written_to_has_its_code_in_the_users_cache(
    toy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (toy / "__pycache__").touch()  # no folder can be made there, not by root either
    folder = folder_of_code(toy)
    assert folder.is_dir()
    assert folder.parent == tmp_path / "cache" / "styletrf"


def test_the_users_settings_of_numba_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    compiled()(lambda x: x)
    assert str(tmp_path) == numba.config.CACHE_DIR


def test_only_this_module_keeps_compiled_code():
    """Whoever calls numba's own decorators with `cache=True` has stale code again."""
    texts = {path: path.read_text() for path in (ROOT / "styletrf").rglob("*.py")}
    for path in (path for path, text in texts.items() if "cache" in text):
        calls = (n for n in ast.walk(ast.parse(texts[path])) if isinstance(n, ast.Call))
        cached = [c for c in calls if any(word.arg == "cache" for word in c.keywords)]
        assert not cached or path.name == "compiled.py", path


def _compiled_functions(tree: ast.Module) -> list[ast.FunctionDef]:
    marks = ("compiled(", "kernel")
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    return [f for f in functions if any(ast.unparse(d).startswith(marks) for d in f.decorator_list)]


@pytest.mark.parametrize(
    "package",
    [
        "styletrf.field.kernels",
        "styletrf.synthetic.courtyard",
        "styletrf.viewer",
        "styletrf.exports",
        "styletrf.sfm.matching",
    ],
)
def test_what_is_compiled_uses_only_its_own_package(package: str):
    """The folder's name covers one package, so nothing else may be compiled into its functions."""
    n_functions = 0
    for path in ROOT.joinpath(*package.split(".")).glob("*.py"):
        tree = ast.parse(path.read_text())
        functions = _compiled_functions(tree)
        n_functions += len(functions)
        used = {n.id for f in functions for n in ast.walk(f) if isinstance(n, ast.Name)}
        marks = {n.id for f in functions for d in f.decorator_list for n in ast.walk(d)
                 if isinstance(n, ast.Name)}  # fmt: skip
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("styletrf"):
                names = {alias.asname or alias.name for alias in node.names} & used - marks
                assert not names or f"{node.module}.".startswith(f"{package}."), (path, names)
    assert n_functions > 0
