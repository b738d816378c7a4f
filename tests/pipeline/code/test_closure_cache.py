"""Closures on disk: found again while the files are the same, and never otherwise."""

import ast
import itertools
import shutil

import pytest

import tasks
from pipeline.code import closure_cache, source
from pipeline.code.closure import code_closure, follow_closure
from pipeline.code.closure_cache import cached_closure, sources_digest

counter = itertools.count()


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of one module and one data file, which can be imported."""
    folder = tmp_path / f"cached_toy_{next(counter)}"
    folder.mkdir()
    for name in ("__init__.py", "code.py", "data.json"):
        (folder / name).write_text("1\n")
    monkeypatch.syspath_prepend(tmp_path)
    return folder


@pytest.fixture
def closure(package, tmp_path):
    """A function that counts how often the closure was followed rather than found."""

    class Counted:
        followed = 0

        def __call__(self, name="task", during=lambda: None):
            return cached_closure(
                name, [package.name], lambda: self._follow(during), tmp_path / "cache"
            )

        def _follow(self, during):
            self.followed += 1
            during()
            return {"code": str(self.followed)}

    return Counted()


def test_a_closure_is_followed_once_while_the_files_are_the_same(closure):
    assert closure() == closure() == {"code": "1"}
    assert closure("other") == {"code": "2"}
    assert closure() == {"code": "1"}


@pytest.mark.parametrize("name", ["code.py", "data.json", "new.py"])
def test_any_changed_or_new_file_makes_it_followed_again(closure, package, name):
    before = closure()
    (package / name).write_text("2\n")
    assert closure() != before
    assert closure() == {"code": "2"}


def test_a_removed_file_makes_it_followed_again(closure, package):
    closure()
    (package / "data.json").unlink()
    assert closure() == {"code": "2"}


def test_what_python_keeps_beside_the_files_changes_nothing(closure, package):
    closure()
    (package / "__pycache__").mkdir()
    (package / "__pycache__" / "code.pyc").write_text("2")
    assert closure() == {"code": "1"}


def test_a_file_that_changes_meanwhile_leaves_nothing(closure, package):
    """What was followed may be of either version."""
    text = (package / "code.py").read_text()
    closure(during=lambda: (package / "code.py").write_text("2\n"))
    (package / "code.py").write_text(text)
    assert closure() == {"code": "2"}


@pytest.mark.parametrize("damage", ["", "{", "[]", "{}", '{"digest": "", "closure": {}}'])
def test_a_damaged_file_counts_as_absent(closure, tmp_path, damage):
    closure()
    (kept,) = (tmp_path / "cache").rglob("*.json")
    kept.write_text(damage)
    assert closure() == {"code": "2"}
    assert closure() == {"code": "2"}


def test_an_altered_closure_counts_as_absent(closure, tmp_path):
    closure()
    (kept,) = (tmp_path / "cache").rglob("*.json")
    kept.write_text(kept.read_text().replace('{"code": "1"}', '{"code": "7"}'))
    assert closure() == {"code": "2"}


def test_a_process_with_older_code_of_the_pipeline_keeps_nothing_for_the_newer(
    closure, monkeypatch
):
    with monkeypatch.context() as patch:
        patch.setattr(closure_cache, "_PIPELINE_DIGEST", "older")
        assert closure() == {"code": "1"}
    assert closure() == {"code": "2"}


def test_a_file_that_cannot_be_read_is_no_reason_to_fail(closure, package, monkeypatch):
    def fail(_path):
        raise FileNotFoundError

    monkeypatch.setattr(closure_cache, "file_digest", fail)
    assert closure() == {"code": "1"}


def test_nothing_is_left_beside_the_closures(closure, tmp_path):
    closure()
    assert {path.suffix for path in (tmp_path / "cache").rglob("*") if path.is_file()} == {".json"}


def test_a_folder_that_cannot_be_written_to_keeps_nothing(closure, tmp_path):
    (tmp_path / "cache").touch()
    assert [closure(), closure()] == [{"code": "1"}, {"code": "2"}]


def test_closures_of_earlier_files_are_removed(closure, package, tmp_path):
    for k in range(3):
        (package / "code.py").write_text(f"{k}\n")
        closure()
    assert len(list((tmp_path / "cache").rglob("*.json"))) == 1


def test_the_closure_of_a_task_is_the_one_that_is_followed(monkeypatch):
    task = tasks.StyleImage
    assert code_closure(task) == follow_closure(task.__module__, task.__qualname__)
    monkeypatch.setattr(ast, "parse", lambda *_: pytest.fail("it was followed again"))
    source._parse.cache_clear()
    assert code_closure(task)


def test_a_copy_of_a_package_has_the_digest_of_the_package(package, tmp_path, monkeypatch):
    """It depends on no place and no time."""
    before = sources_digest([package.name])
    shutil.copytree(package, tmp_path / "elsewhere" / package.name)
    shutil.rmtree(package)
    monkeypatch.syspath_prepend(tmp_path / "elsewhere")
    assert sources_digest([package.name]) == before


def test_a_file_that_vanishes_while_the_module_is_imported_only_costs_time(closure, monkeypatch):
    def fail(_path):
        raise FileNotFoundError

    with monkeypatch.context() as patch:
        patch.setattr(closure_cache, "file_digest", fail)
        follower = closure_cache.pipeline_digest()
    monkeypatch.setattr(closure_cache, "_PIPELINE_DIGEST", follower)
    assert [closure(), closure()] == [{"code": "1"}, {"code": "2"}]
