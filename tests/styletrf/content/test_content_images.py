import json
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
from damaged_zips import FAULTS, spoil_first_member
from expected_errors import rejects
from huge_pictures import huge_png

from styletrf.configuration import configured
from styletrf.content import content_images
from styletrf.content.content_images import ContentConfig, write_content_images
from styletrf.content.content_sources import (
    ContentSource,
    embedded_source,
    folder_source,
    zip_source,
)
from styletrf.errors import InputError


def photographs(folder: Path, count: int, height: int = 90, width: int = 120) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for k in range(count):
        pixels = np.random.default_rng(k).integers(0, 256, (height // 16, width // 16, 3), np.uint8)
        image = cv2.resize(pixels, (width, height), interpolation=cv2.INTER_CUBIC)
        cv2.imwrite(str(folder / f"{k:03d}.jpg"), image)
    return folder


def written(source: ContentSource, folder: Path, config: ContentConfig) -> Path:
    folder.mkdir(parents=True)
    write_content_images(source, folder, config)
    return folder


def rows(folder: Path) -> list[dict]:
    shards = sorted(folder.glob("content-*.parquet"))
    return [row for shard in shards for row in pq.read_table(shard).to_pylist()]


def test_rows_hold_reduced_images_of_the_same_shape_and_content(tmp_path: Path):
    source = folder_source(photographs(tmp_path / "in", 9))
    table = rows(written(source, tmp_path / "out", ContentConfig(min_side_px=64)))
    assert sorted(row["id"] for row in table) == [f"{k:03d}.jpg" for k in range(9)]
    for row in table:
        assert (row["width"], row["height"]) == (85, 64)
        found = cv2.imdecode(np.frombuffer(row["encoded"], np.uint8), cv2.IMREAD_COLOR)
        original = cv2.imread(str(tmp_path / "in" / row["id"]))
        expected = cv2.resize(original, (85, 64), interpolation=cv2.INTER_AREA)
        assert np.abs(found.astype(float) - expected).mean() < 4


def test_small_images_are_not_enlarged(tmp_path: Path):
    source = folder_source(photographs(tmp_path / "in", 8))
    table = rows(written(source, tmp_path / "out", ContentConfig(min_side_px=288)))
    assert {(row["width"], row["height"]) for row in table} == {(120, 90)}


def test_same_source_same_bytes_and_the_seed_draws(tmp_path: Path):
    source = folder_source(photographs(tmp_path / "in", 20))
    config = ContentConfig(count=8, min_side_px=64)
    a = written(source, tmp_path / "a", config)
    b = written(source, tmp_path / "b", config)
    other = written(source, tmp_path / "c", ContentConfig(count=8, min_side_px=64, seed=1))
    assert sorted(file.name for file in a.iterdir()) == ["content-00000.parquet", "content.json"]
    for file in a.iterdir():
        assert file.read_bytes() == (b / file.name).read_bytes()
    assert {row["id"] for row in rows(a)} != {row["id"] for row in rows(other)}
    assert len(rows(other)) == 8


def test_shards_are_cut_at_their_size_and_lose_nothing(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(content_images, "_SHARD_BYTES", 10_000)
    source = folder_source(photographs(tmp_path / "in", 12))
    folder = written(source, tmp_path / "out", ContentConfig())
    shards = sorted(folder.glob("*.parquet"))
    assert len(shards) > 2
    assert shards[1].name == "content-00001.parquet"
    assert len({row["id"] for row in rows(folder)}) == len(rows(folder)) == 12


def test_an_image_too_long_for_a_jpeg_is_skipped(tmp_path: Path):
    """It ended in a traceback."""
    folder = photographs(tmp_path / "in", 8)
    cv2.imwrite(str(folder / "scroll.png"), np.zeros((80, 66_000, 3), np.uint8))
    (tmp_path / "out").mkdir()
    summary = write_content_images(folder_source(folder), tmp_path / "out", ContentConfig())
    assert (summary.count, summary.skipped) == (8, ("scroll.png",))


def test_damaged_tiny_and_huge_images_are_skipped_replaced_and_named(tmp_path: Path):
    folder = photographs(tmp_path / "in", 12)
    whole = (folder / "000.jpg").read_bytes()
    (folder / "truncated.jpg").write_bytes(whole[: len(whole) // 2])
    (folder / "empty.png").write_bytes(b"")
    (folder / "text.jpg").write_text("no image")
    cv2.imwrite(str(folder / "tiny.png"), np.zeros((10, 300, 3), np.uint8))
    (folder / "huge.png").write_bytes(huge_png())
    names = ("empty.png", "huge.png", "text.jpg", "tiny.png", "truncated.jpg")
    (tmp_path / "out").mkdir()
    summary = write_content_images(folder_source(folder), tmp_path / "out", ContentConfig(count=12))
    assert summary.count == len(rows(tmp_path / "out")) == 12
    assert set(summary.skipped) <= set(names)
    (tmp_path / "all").mkdir()
    everything = write_content_images(folder_source(folder), tmp_path / "all", ContentConfig())
    assert everything.skipped == names
    assert json.loads((tmp_path / "all" / "content.json").read_text())["count"] == 12


@pytest.mark.parametrize("fault", FAULTS)
def test_a_damaged_member_of_a_zip_is_skipped_and_the_zip_is_closed(tmp_path: Path, fault: str):
    """The error of the decompression ended the stage."""
    folder, path = photographs(tmp_path / "in", 9), tmp_path / "train.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.iterdir()):
            archive.write(file, file.name)
    spoil_first_member(path, fault)
    source = zip_source(path)
    (tmp_path / "out").mkdir()
    summary = write_content_images(source, tmp_path / "out", ContentConfig())
    assert (summary.count, summary.skipped) == (8, ("000.jpg",))
    with pytest.raises(ValueError, match="closed"):
        source.read("001.jpg")


def test_too_few_usable_images_are_an_input_error(tmp_path: Path):
    folder = photographs(tmp_path / "in", 7)
    (folder / "text.jpg").write_text("no image")
    (tmp_path / "out").mkdir()
    with rejects(folder, 7, 8, "text.jpg"):
        write_content_images(folder_source(folder), tmp_path / "out", ContentConfig())


def test_an_error_of_the_source_ends_it(tmp_path: Path):
    def fail(name: str) -> bytes:
        raise InputError(name, "the network is gone", "Plug it in")

    with rejects("a", "the network is gone"):
        write_content_images(ContentSource("x", ("a", "b"), fail), tmp_path, ContentConfig())


def test_progress_counts_to_the_number_wanted(tmp_path: Path):
    calls = []
    source = embedded_source([], n_procedural=9, seed=0)
    write_content_images(source, tmp_path, ContentConfig(), lambda *done: calls.append(done))
    assert calls == [(k, 9) for k in range(1, 10)]


@pytest.mark.parametrize(
    ("name", "value"),
    [("min_side_px", 0), ("min_side_px", 63), ("count", 0), ("count", -5), ("count", 7),
     ("smallest_count", 0), ("smallest_count", -3)],
)  # fmt: skip
def test_settings_that_no_image_or_too_few_can_meet_are_refused(name, value):
    """The size ended in a traceback for every image, and a negative count kept all."""
    with rejects(f"setting {name!r}", name, str(value)):
        configured(ContentConfig, {name: value})
    assert configured(ContentConfig, {"count": 3, "smallest_count": 3}).count == 3
