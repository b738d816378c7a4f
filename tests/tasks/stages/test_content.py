"""The user's own content: what it costs to know it, where it is kept, and what there is without."""

import json
import os
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from expected_errors import rejects

import tasks
from pipeline.task import RunContext
from styletrf.content import content_sources
from tasks.machine import digest_cache


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A data root with one archive of content, some time old."""
    (tmp_path / "data/content").mkdir(parents=True)
    monkeypatch.setenv("STYLETRF_DATA", str(tmp_path / "data"))
    fill(tmp_path / "data/content/train.zip", "one")
    return tmp_path / "data"


def fill(archive: Path, text: str, age_s: float = 60) -> None:
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("a.jpg", text)
    then = archive.stat().st_mtime - age_s
    os.utime(archive, (then, then))


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the files that are hashed, as they are."""
    names: list[str] = []
    digest = digest_cache.file_digest

    def noted(path: Path) -> str:
        names.append(path.name)
        return digest(path)

    monkeypatch.setattr(digest_cache, "file_digest", noted)
    return names


def test_an_archive_is_read_once_and_not_by_every_command(data: Path, reads: list[str]):
    stage = tasks.ContentImages(scene="s")
    before = stage.external_digests()
    assert stage.external_digests() == before
    assert reads == ["train.zip"]
    fill(data / "content/train.zip", "two", age_s=30)
    assert stage.external_digests() != before
    assert reads == ["train.zip"] * 2


def test_what_was_written_just_now_is_read_again(data: Path, reads: list[str]):
    """Its next change might fall into the same tick of the clock."""
    fill(data / "content/train.zip", "two", age_s=0)
    for _ in range(2):
        tasks.ContentImages(scene="s").external_digests()
    assert reads == ["train.zip"] * 2


@pytest.mark.parametrize("damaged", ["", "[1", '{"a": 1}', "[]"])
def test_a_damaged_memory_is_forgotten(data: Path, reads: list[str], tmp_path: Path, damaged: str):
    stage = tasks.ContentImages(scene="s")
    before = stage.external_digests()
    (tmp_path / "store/digests.json").write_text(damaged)
    assert stage.external_digests() == before
    assert reads == ["train.zip"] * 2


def test_ambiguous_content_fails_in_the_run_and_not_in_the_graph(data: Path):
    fill(data / "content/val.zip", "two")
    stage = tasks.ContentImages(scene="s")
    assert stage.requires() == {}
    assert not stage.complete()
    with rejects("--content auto", data / "content", "train.zip", "val.zip"):
        stage.external_digests()


def test_content_of_an_unreadable_name_is_to_be_renamed(data: Path):
    (data / "content/train.zip").unlink()
    (data / "content/photos").mkdir()
    (data / "content/photos" / os.fsdecode(b"caf\xe9.jpg")).touch()
    with rejects("photos/caf\N{REPLACEMENT CHARACTER}.jpg", "UTF-8"):
        tasks.ContentImages(scene="s").external_digests()


def test_images_behind_a_link_are_content_and_change_the_key(data: Path, tmp_path: Path):
    (data / "content/train.zip").unlink()
    for name in ("disk/a.jpg", "disk/far/b.jpg"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    (data / "content/photos").mkdir()
    (data / "content/photos/disk").symlink_to(tmp_path / "disk")
    stage = tasks.ContentImages(scene="s")  # whose content is the one folder that has images
    before = stage.external_digests()
    assert set(before) == {"photos/disk/a.jpg", "photos/disk/far/b.jpg"}
    (tmp_path / "disk/far/b.jpg").write_text("another")
    assert stage.external_digests() != before


def test_what_is_fetched_stays_with_the_data(data: Path, build: Callable[..., Path]):
    """Offline, only what is kept can be read."""
    listed = [{"file_name": f"{k}.png", "coco_url": f"http://0.0.0.0/{k}"} for k in range(8)]
    annotations = data / "content/some.json"
    annotations.write_text(json.dumps({"images": listed}))
    stage = tasks.ContentImages(scene="s", content="some.json", settings={"count": 8})
    kept = stage.fetched(annotations, data / "resume")
    assert kept.is_relative_to(data / "content/.fetched")
    for entry in listed:
        image = np.random.default_rng(0).integers(0, 256, (80, 80, 3), dtype=np.uint8)
        cv2.imwrite(str(kept / entry["file_name"]), image)
    made = build(stage)
    assert json.loads((made / "content.json").read_text())["count"] == 8
    assert len(list(kept.iterdir())) == 8


def test_what_cannot_be_kept_with_the_data_is_kept_with_the_build(data: Path, tmp_path: Path):
    (data / "content/.fetched").touch()  # no folder can be made there
    annotations = data / "content/some.json"
    annotations.touch()
    stage = tasks.ContentImages(scene="s", content="some.json")
    assert stage.fetched(annotations, tmp_path / "resume") == tmp_path / "resume"
    assert (tmp_path / "resume").is_dir()


def test_three_photographs_are_content_enough(
    photographs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """With as many procedural images they would be six, fewer than a training may have."""
    monkeypatch.setattr(content_sources, "_PROCEDURAL_SHAPE", (96, 120))
    images = tmp_path / "capture/images"
    images.mkdir(parents=True)
    for path in sorted((photographs / "scenes/mini/images").iterdir())[:3]:
        (images / path.name).write_bytes(path.read_bytes())
    (tmp_path / "out").mkdir()
    words = {"scene": "mini", "content": "embedded", "quality": "draft"}
    stage = tasks.ContentImages(**words, settings={"min_side_px": 64})
    context = RunContext(lambda *_, **__: None, tmp_path / "resume", tmp_path / "log")
    stage.build({"capture": tmp_path / "capture"}, tmp_path / "out", context)
    assert json.loads((tmp_path / "out/content.json").read_text())["count"] == 3 + 64


def test_a_folder_of_three_images_is_refused_with_what_is_needed(
    build: Callable[..., Path], photographs: Path, tmp_path: Path
):
    for path in sorted((photographs / "scenes/mini/images").iterdir())[:3]:
        shutil.copy(path, tmp_path)
    stage = tasks.ContentImages(scene="mini", content=str(tmp_path))
    with rejects(tmp_path, 3, 8):
        build(stage)
