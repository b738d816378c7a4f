"""The folders of links in `out/`: several commands may fill one, and users keep links there."""

from collections.abc import Callable
from pathlib import Path

import luigi
import pytest

from pipeline.settings import current_store, out_root
from pipeline.task import RunContext, StoredTask, artifact
from tasks.stages.linked_results import LinkedStage

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


def test_a_link_to_a_collected_artifact_is_removed(out):
    first = published(1)
    target = artifact(first)
    (out / "mini/other.html").symlink_to(target / "index.html")
    current_store().set_aside(target, "trash")
    published(2)
    assert not (out / "mini/other.html").is_symlink()
