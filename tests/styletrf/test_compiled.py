"""Compiled code follows all that it was compiled from, and is kept where nothing changed."""

import ast
import os
import subprocess
import sys
import time
from pathlib import Path

import numba
import pytest
from compiled_sources import functions_in, sources_outside

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
    """The result of the outer function in a fresh process, and how often it had to compile.

    Python itself would not see a file that changes twice within a second.
    """
    path = os.pathsep.join([str(toy.parent), str(ROOT)])
    environment = {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1", **variables}
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


def test_files_of_a_functions_folder_are_all_that_is_compiled_into_it():
    """The name of the folder of compiled code covers those files, and no others."""
    files = [each for each in (ROOT / "styletrf").rglob("*.py") if functions_in(ROOT, each)]
    assert "lighting.py" in {file.name for file in files}, "its decorator is that of another file"
    assert {file: found for file in files if (found := sources_outside(ROOT, file))} == {}


@pytest.mark.parametrize(
    ("imports", "used"),
    [
        ("from toy.below.deep import SCALE", "SCALE"),
        ("from toy.below import deep", "deep.SCALE"),
        ("import toy.below.deep", "toy.below.deep.SCALE"),
        ("from toy.below.deep import SCALE\nHALF = SCALE / 2", "HALF"),
        ("from toy.beside import SCALE", "SCALE"),
    ],
)
def test_what_is_compiled_in_from_another_folder_is_found(toy: Path, imports: str, used: str):
    """Names in a package below were allowed, and attributes of modules were not seen."""
    (toy / "below").mkdir()
    (toy / "below/deep.py").write_text("SCALE = 2.0\n")
    (toy / "beside.py").write_text("from toy.below.deep import SCALE\n")
    (toy.parent / "styletrf").mkdir()
    (toy.parent / "styletrf/compiled.py").write_text("def compiled(): ...\n")
    assert sources_outside(toy.parent, toy / "outer.py") == set()
    text = PACKAGE["outer.py"].replace("+ 1.0", f"+ {used}")
    (toy / "other.py").write_text(f"{imports}\n{text}")
    assert (toy / "below/deep.py", "SCALE") in sources_outside(toy.parent, toy / "other.py")
