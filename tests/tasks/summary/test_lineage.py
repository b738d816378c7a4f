"""The lineage of a scene: what its pages were made from, and what was requested in vain."""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import luigi
import pytest
from message_words import mentions

import tasks
from pipeline.errors import TaskFailure
from pipeline.job import write_outcome
from pipeline.settings import current_store
from pipeline.task import RunContext, StoredTask
from tasks.stages.linked_results import LinkedStage, linked_pages, made_from
from tasks.stages.stage import Stage
from tasks.summary.gallery import refresh_gallery
from tasks.summary.lineage import lineage, write_lineages


class PaintingPage(LinkedStage):
    """A page made from one painting."""

    scene, style = luigi.Parameter(), luigi.Parameter()
    page, revision = "page.html", "1"

    def requires(self) -> Mapping[str, Stage]:
        return {"style": tasks.StyleImage(style=self.style, executor="inline")}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        (out / "page.html").write_text("<p>")

    @property
    def folder(self) -> Path:
        return Path(tasks.results.trajectory.out_root(), self.scene, self.style)

    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        return {"page.html": place(self) / "page.html"}


def page(style: str, scene: str = "mini") -> PaintingPage:
    return PaintingPage(scene=scene, style=style, executor="inline")


def made(style: str) -> PaintingPage:
    result = page(style)
    for task in (result.requires()["style"], result):
        task.run()
    return result


def test_a_page_says_what_it_was_made_from_also_to_later_commands(out: Path):
    first, second = made("p"), made("q")
    assert linked_pages(out / "mini") == [out / f"mini/{style}/page.html" for style in "pq"]
    upstream = first.requires()["style"].record().action.key
    assert made_from(out / "mini/p/page.html") == [upstream, first.record().action.key]
    found = {each.name: each for each in lineage(out / "mini", [])}
    assert len(found) == 4
    for result in (first, second):
        own = found[result.record().action.key]
        assert (own.painting, own.page) == (result.style, f"{result.style}/page.html")
        (image,) = own.inputs
        assert (found[image].family, found[image].state) == ("StyleImage", "made")
        assert found[image].size_bytes > 0


@pytest.mark.parametrize("style", ["Wave (1)", "Monet, lilies", "a) b, c"])
def test_a_painting_keeps_its_name_whatever_marks_are_in_it(
    out: Path, photographs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, style: str
):
    """It ended at a comma or a parenthesis, so that several paintings were one."""
    styles = tmp_path / "data/styles"
    styles.mkdir(parents=True)
    shutil.copy(photographs / "styles/p.png", styles / f"{style}.png")
    monkeypatch.setenv("STYLETRF_DATA", str(tmp_path / "data"))
    made(style)
    paintings = {each.family: each.painting for each in lineage(out / "mini", [])}
    assert paintings == {"StyleImage": style, "PaintingPage": style}


def test_pages_of_any_kind_and_depth_are_found(out: Path):
    made("p")
    deeper = out / "mini/export/ply"
    deeper.mkdir(parents=True)
    for name in ("page.html", "page.html.keys"):
        (deeper / name.replace("html", "json")).write_bytes((out / "mini/p" / name).read_bytes())
    assert linked_pages(out / "mini") == [deeper / "page.json", out / "mini/p/page.html"]


def test_what_left_the_store_was_made_all_the_same(out: Path):
    result = made("p")
    record = result.requires()["style"].record()
    current_store().set_aside(current_store().object(record.output.digest), "trash")
    states = {each.family: each.state for each in lineage(out / "mini", [])}
    assert states == {"StyleImage": "removed", "PaintingPage": "made"}


def test_a_page_that_is_gone_is_in_no_lineage(out: Path):
    made("p")
    shutil.rmtree(out / "mini/p")
    made("q")
    (out / "mini/q/page.html").unlink()
    assert lineage(out / "mini", []) == []


def test_what_failed_says_why_and_the_rest_waits(out: Path):
    result = page("none")
    with pytest.raises(TaskFailure):
        result.requires()["style"].run()
    found = {each.family: each for each in lineage(out / "mini", [result])}
    assert found["StyleImage"].state == "failed"
    assert "none" in found["StyleImage"].reason
    assert found["PaintingPage"].state == "not made"
    assert found["PaintingPage"].inputs == [found["StyleImage"].name]


def test_a_stage_skipped_for_until_is_not_made_and_says_why(out: Path):
    image = page("p").requires()["style"]
    log = current_store().new_log(image.task_family, image.action().key)
    write_outcome(log, "late", "5 s are left")
    found = {each.family: each for each in lineage(out / "mini", [page("p")])}
    assert (found["StyleImage"].state, found["StyleImage"].reason) == ("not made", "5 s are left")


def test_the_pages_lie_in_the_folders_of_scenes_and_the_gallery_leads_there(out: Path):
    write_lineages([page("none"), page("none", "../elsewhere"), page("none", "..")])
    assert sorted(out.rglob("*.html")) == [out / "mini/lineage.html"]
    assert not (out.parent / "elsewhere").exists()
    assert 'href="mini/lineage.html"' in refresh_gallery(None).read_text()


def test_a_lineage_that_cannot_be_written_is_no_failure(out: Path, caplog):
    (out / "mini/lineage.html/x").mkdir(parents=True)
    write_lineages([page("none")])
    (message,) = caplog.messages
    assert mentions(message, "mini")
