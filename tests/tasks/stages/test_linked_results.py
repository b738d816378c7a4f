"""The folders of links in `out/`: several commands may fill one, and users keep links there."""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

import luigi
import pytest

from pipeline.settings import current_store, out_root
from pipeline.task import RunContext, StoredTask, artifact
from tasks.stages import linked_results
from tasks.stages.linked_results import LinkedStage, made_from

pytestmark = pytest.mark.usefixtures("inline")


class Album(LinkedStage):
    """Two pages."""

    edition = luigi.IntParameter()
    page, revision = "page.html", "1"

    def build(self, inputs: object, out: Path, run: RunContext) -> None:
        for name in ("page.html", "index.html"):
            (out / name).write_text(f"{self.edition}")

    @property
    def folder(self) -> Path:
        return Path(out_root(), "mini")

    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        return {name: place(self) / name for name in ("page.html", "index.html")}


def published(edition: int) -> Album:
    album = Album(edition=edition)
    album.run()
    assert album.published()
    return album


def test_a_result_that_two_commands_publish_at_once_is_linked_by_both(out, monkeypatch):
    """The one removed what the other was about to rename."""
    album, symlink_to, others = published(1), Path.symlink_to, []

    def symlink_and_meet(path: Path, target: Path) -> None:
        symlink_to(path, target)
        if not others:
            others.append(path)
            album.publish(artifact(album))

    monkeypatch.setattr(Path, "symlink_to", symlink_and_meet)
    album.publish(artifact(album))
    assert others
    assert album.published()
    assert {path.name for path in out.glob("mini/*")} == {
        "page.html",
        "index.html",
        "page.html.keys",
    }


def test_links_of_an_earlier_result_are_removed_and_those_of_the_user_stay(out, tmp_path):
    """A user's link to a folder of theirs was deleted by each command."""
    first = published(1)
    stale, own, broken = (out / "mini" / name for name in ("other.html", "mine", "away"))
    stale.symlink_to(artifact(first) / "index.html")
    own.symlink_to(tmp_path)
    broken.symlink_to(tmp_path / "nothing")
    published(2)
    assert not stale.is_symlink()
    assert own.is_symlink()
    assert broken.is_symlink()
    assert (out / "mini/page.html").read_text() == "2"


def is_interrupted(album: Album, calls: int, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Publishes; returns whether Ctrl-C ended it, after some calls of `Path.replace`."""
    replace, left = Path.replace, iter(range(calls))

    def replace_or_stop(path: Path, target: Path) -> Path:
        if next(left, None) is None:
            raise KeyboardInterrupt
        return replace(path, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", replace_or_stop)
        try:
            album.publish(artifact(album))
        except KeyboardInterrupt:
            return True
    return False


def test_an_interrupted_publication_does_not_count_and_has_no_keys_of_another_result(
    out, monkeypatch
):
    """All new links, with the keys of the old result, counted as published."""
    first, second = published(1), published(2)
    page, calls = out / "mini/page.html", 0
    first.publish(artifact(first))
    while is_interrupted(second, calls, monkeypatch):
        assert not second.published()
        assert page.read_text() == "1" or made_from(page) == []
        first.publish(artifact(first))
        calls += 1
    assert calls > len(second.links(artifact))
    assert second.published()
    assert made_from(page) == [second.action().key]


def test_a_result_does_not_count_with_the_keys_of_another_command(out, monkeypatch):
    """The one wrote its keys last, the other its links: the latter counted as published."""
    first, second = published(1), published(2)
    write = linked_results.atomic_write

    @contextlib.contextmanager
    def write_after_another(path: Path) -> Iterator[Path]:
        monkeypatch.setattr(linked_results, "atomic_write", write)
        second.publish(artifact(second))
        with write(path) as file:
            yield file

    monkeypatch.setattr(linked_results, "atomic_write", write_after_another)
    first.publish(artifact(first))
    assert (out / "mini/page.html").read_text() == "2"
    assert not first.published()
    assert not second.published()
    second.run()
    assert second.published()


def test_a_link_to_a_collected_artifact_is_removed(out):
    first = published(1)
    target = artifact(first)
    (out / "mini/other.html").symlink_to(target / "index.html")
    current_store().set_aside(target, "trash")
    published(2)
    assert not (out / "mini/other.html").is_symlink()
