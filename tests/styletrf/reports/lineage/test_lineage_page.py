"""The lineage of a scene as a page: complete, harmless, and usable in a browser."""

from dataclasses import replace
from pathlib import Path

from headless import answer_of, needs_chromium
from parsed_page import HOSTILE, Page

from styletrf.reports.lineage.artifact import Artifact
from styletrf.reports.lineage.page import write_lineage_page

MADE = Artifact(
    "ab" * 32, "CameraPoses", "CameraPoses draft horns", "made", made="2026-11-23T20:00:00+00:00",
    seconds=75.2, size_bytes=6_700_000, host="desk",
)  # fmt: skip
FIELD = replace(MADE, name="cd" * 32, family="RadianceField", inputs=[MADE.name], state="removed")
FAILED = Artifact(
    "t", "StyleImage", "StyleImage udnie", "failed", painting="udnie", reason="no such style"
)
WAITS = Artifact(
    "w", "StylizedField", "StylizedField udnie", "not made", [FIELD.name, "t"], "udnie"
)
REPORT = replace(
    FIELD, name="ef" * 32, family="SceneReport", state="made", page="scene-report/report.html"
)
ALL = [WAITS, FAILED, REPORT, FIELD, MADE]


def written(tmp_path: Path, scene: str, artifacts: list[Artifact]) -> Page:
    write_lineage_page(tmp_path / "lineage.html", scene, artifacts)
    return Page((tmp_path / "lineage.html").read_text())


def test_each_artifact_has_its_state_age_size_and_seconds(tmp_path: Path):
    page = written(tmp_path, "horns", ALL)
    for words in (
        *("5 artifacts, 1 removed, 1 failed, 1 not made", "1 min 15 s", "6.7 MB", "desk"),
        *("2026-11-23 20:00", "no such style", "RadianceField", "abababababab", "udnie"),
    ):
        assert words in page.text
    assert page.tags.count("tr") == 1 + len(ALL)
    assert page.tags.count("path") == 1 + 4, "an arrowhead, and four arrows"
    assert "scene-report/report.html" in page.addresses
    assert all(a.startswith("#artifact-") for a in page.addresses if not a.startswith("scene"))


def test_markup_in_names_of_a_lineage_stays_text(tmp_path: Path):
    harmless = written(tmp_path, "horns", [MADE, replace(FAILED, inputs=[MADE.name])])
    words = dict.fromkeys(("family", "label", "painting", "reason"), HOSTILE)
    of_record = dict.fromkeys(("name", "family", "label", "host", "made"), HOSTILE)
    hostile = [replace(MADE, **of_record), replace(FAILED, inputs=[HOSTILE], **words)]
    page = written(tmp_path, HOSTILE, hostile)
    assert sorted(page.tags) == sorted(harmless.tags)
    assert page.text.count(HOSTILE) >= 4


def test_a_scene_without_artifacts_has_a_page(tmp_path: Path):
    assert "Nothing yet." in written(tmp_path, "horns", []).text


PROBE = """
  const all = (selector) => [...document.querySelectorAll(selector)];
  const card = (family) => all(".artifact").find((each) => each.textContent.includes(family));
  const names = () => all(".artifact.related span").map((each) => each.textContent);
  card("RadianceField").dispatchEvent(new PointerEvent("pointerenter"));
  const related = names(), lines = document.querySelectorAll("path.related").length;
  card("RadianceField").dispatchEvent(new PointerEvent("pointerleave"));
  const after = names().length;
  const cards = all(".artifact");
  const targets = cards.every((c) => document.querySelector(c.getAttribute("href")));
  const cut = cards.filter((c) => c.scrollHeight > c.clientHeight + 1).length;
  return { related, lines, after, targets, cut, overflow: overflow(),
    age: document.querySelector(".artifact time").textContent };
"""


@needs_chromium
def test_pointing_at_an_artifact_shows_what_it_is_related_to(tmp_path: Path):
    write_lineage_page(tmp_path / "lineage.html", "horns", ALL)
    answer = answer_of(tmp_path / "lineage.html", PROBE, 390)
    assert answer["errors"] == []
    assert set(answer["related"]) == {"CameraPoses", "RadianceField", "StylizedField"}
    assert (answer["lines"], answer["after"], answer["targets"], answer["cut"]) == (2, 0, True, 0)
    assert answer["age"].endswith("ago") or answer["age"] == "just now"
    assert answer["overflow"] == 0
