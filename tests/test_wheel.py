"""What is installed: all that lies below the packages, so that nothing needs the repository."""

import io
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("pipeline", "styletrf", "tasks")
BUILD = "import sys; from setuptools import build_meta as b; b.build_{}(sys.argv[1])"
"""What pip and `python -m build` call, with the setuptools of this environment: no downloads."""


def files_of_git(*places: str) -> list[str]:
    """The files below these places that are in the repository, or are not ignored."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", *places]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [name for name in names.split("\0") if (ROOT / name).is_file()]


def build(kind: str, source: Path) -> bytes:
    """Builds a `wheel` or an `sdist` of a folder, which gets what setuptools leaves behind."""
    out = source / "made"
    out.mkdir(exist_ok=True)
    command = [sys.executable, "-c", BUILD.format(kind), str(out)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    (made,) = out.glob({"wheel": "*.whl", "sdist": "*.tar.gz"}[kind])
    return made.read_bytes()


def files_of_wheel(wheel: bytes) -> dict[str, bytes]:
    """The files of a wheel, without the list of them, whose order is free."""
    with zipfile.ZipFile(io.BytesIO(wheel)) as archive:
        names = [name for name in archive.namelist() if not name.endswith(".dist-info/RECORD")]
        return {name: archive.read(name) for name in names}


@pytest.fixture(scope="module")
def repository(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what the repository has, without what builds or editors left in the checkout."""
    folder = tmp_path_factory.mktemp("repository")
    tops = [path.name for path in ROOT.iterdir() if path.is_file()]
    for name in files_of_git(*tops, *PACKAGES, "tests"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name, follow_symlinks=False)
    return folder


@pytest.fixture(scope="module")
def wheel(repository: Path) -> dict[str, bytes]:
    return files_of_wheel(build("wheel", repository))


def test_a_wheel_has_every_file_of_the_packages_and_no_other(wheel: dict[str, bytes]):
    installed = {name: data for name, data in wheel.items() if ".dist-info/" not in name}
    assert set(installed) == set(files_of_git(*PACKAGES))
    assert {name: (ROOT / name).read_bytes() for name in installed} == installed


def test_a_wheel_of_the_source_distribution_is_the_same(
    repository: Path, wheel: dict[str, bytes], tmp_path: Path
):
    with tarfile.open(fileobj=io.BytesIO(build("sdist", repository))) as archive:
        archive.extractall(tmp_path)
    (source,) = tmp_path.iterdir()
    assert {"CHANGELOG.md", "LICENSE", "README.md"} <= {path.name for path in source.iterdir()}
    assert not (source / "tests").exists(), "they need the whole repository"
    assert files_of_wheel(build("wheel", source)) == wheel
