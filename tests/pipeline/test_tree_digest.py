import os
import subprocess
import sys
from pathlib import Path

import pytest
from expected_failures import refuses

from pipeline.digest import measure, tree_digest


@pytest.fixture
def tree(tmp_path):
    root = tmp_path / "tree"
    (root / "images").mkdir(parents=True)
    (root / "images" / "a.png").write_bytes(b"abc")
    (root / "field.json").write_bytes(b"{}")
    return root


def copy(source: Path, target: Path) -> Path:
    """The same files, made in the opposite order, with other times and modes."""
    for path in sorted(source.rglob("*"), reverse=True):
        if path.is_file():
            other = target / path.relative_to(source)
            other.parent.mkdir(parents=True, exist_ok=True)
            other.write_bytes(path.read_bytes())
            other.chmod(0o600)
            os.utime(other, (1, 1))
    return target


def test_blind_to_place_order_time_and_mode(tree, tmp_path):
    assert tree_digest(copy(tree, tmp_path / "copy")) == tree_digest(tree)


def test_a_tree_digest_counts_bytes_and_files(tree):
    assert (tree_digest(tree).size, tree_digest(tree).files) == (5, 2) == measure(tree)


@pytest.mark.parametrize(
    "alter",
    [
        lambda root: (root / "images" / "a.png").write_bytes(b"abd"),
        lambda root: (root / "images" / "a.png").write_bytes(b"ab"),
        lambda root: (root / "images" / "a.png").rename(root / "images" / "b.png"),
        lambda root: (root / "images" / "a.png").rename(root / "a.png"),
        lambda root: (root / "extra").write_bytes(b""),
        lambda root: (root / "empty").mkdir(),
        lambda root: (root / "field.json").unlink(),
    ],
)
def test_every_change_of_content_gives_another_tree_digest(tree, alter):
    before = tree_digest(tree)
    alter(tree)
    assert tree_digest(tree).digest != before.digest


def test_a_tree_with_a_link_is_refused(tree):
    (tree / "link").symlink_to("field.json")
    with refuses(tree / "link", kind=ValueError):
        tree_digest(tree)


def test_a_tree_digest_is_the_same_in_another_process_and_with_another_hash_seed(tree):
    code = (
        "import pathlib, sys; from pipeline.digest import tree_digest;"
        "sys.stdout.write(tree_digest(pathlib.Path(sys.argv[1])).digest)"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "7", "PYTHONPATH": os.pathsep.join(sys.path)}
    other = subprocess.run(
        [sys.executable, "-c", code, str(tree)],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert other.stdout == tree_digest(tree).digest
