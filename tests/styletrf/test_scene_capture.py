import hashlib

import pytest
from made_photographs import encoded, texture, with_exif

from styletrf.errors import InputError
from styletrf.scene_capture import capture_photographs, read_capture


def photograph(seed, width=24, height=16):
    return encoded(texture(height, width, seed))


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "images"
    folder.mkdir()
    for index in (10, 9, 1):
        (folder / f"view {index}.jpg").write_bytes(photograph(index))
    return folder


def test_the_users_bytes_are_kept_exactly(folder, tmp_path):
    capture = capture_photographs(folder, tmp_path / "out")
    assert [one.name for one in capture.photographs] == ["view 1", "view 9", "view 10"]
    assert {path.name for path in (tmp_path / "out/images").iterdir()} == {
        path.name for path in folder.iterdir()
    }
    for one in capture.photographs:
        data = (tmp_path / "out/images" / one.file).read_bytes()
        assert data == (folder / one.file).read_bytes()
        assert (one.size_bytes, one.sha256) == (len(data), hashlib.sha256(data).hexdigest())
    assert not capture.warnings


def test_the_table_reads_back_and_is_the_same_every_time(folder, tmp_path):
    capture = capture_photographs(folder, tmp_path / "a")
    capture_photographs(folder, tmp_path / "b")
    assert read_capture(tmp_path / "a") == capture
    one, other = ((tmp_path / out / "capture.json").read_bytes() for out in "ab")
    assert one == other


def test_sizes_are_those_of_the_upright_photographs(folder, tmp_path):
    for path in folder.iterdir():
        path.write_bytes(with_exif(path.read_bytes(), orientation=6))
    capture = capture_photographs(folder, tmp_path / "out")
    assert {(one.width, one.height) for one in capture.photographs} == {(16, 24)}


def test_names_stay_apart_where_only_suffixes_differ(folder, tmp_path):
    (folder / "view 1.png").write_bytes(encoded(texture(16, 24), ".png"))
    names = [one.name for one in capture_photographs(folder, tmp_path / "out").photographs]
    assert names == ["view 1.jpg", "view 1.png", "view 9.jpg", "view 10.jpg"]


def test_all_that_is_wrong_is_told_at_once_and_nothing_written(folder, tmp_path):
    (folder / "short.jpg").write_bytes(photograph(5)[:-50])
    (folder / "text.png").write_bytes(b"no image")
    (folder / "tall.jpg").write_bytes(photograph(6, 16, 24))
    with pytest.raises(InputError) as told:
        capture_photographs(folder, tmp_path / "out")
    for part in ("short.jpg", "text.png", "3 of 24x16", "16x24 (tall.jpg)"):
        assert part in str(told.value)
    assert "view" not in told.value.problem
    assert not (tmp_path / "out").exists()


def test_long_lists_are_cut(folder, tmp_path):
    for index in range(4):
        (folder / f"same{index}.jpg").write_bytes(photograph(1))
    for index in range(13):
        (folder / f"other{index}.jpg").write_bytes(photograph(index, 16, 16))
    with pytest.raises(InputError, match=r"24x16 \(same0.jpg.*|and \d+ more"):
        capture_photographs(folder, tmp_path / "out")


def test_duplicates_and_files_to_be_converted_are_warned_of(folder, tmp_path):
    (folder / "copy.jpg").write_bytes((folder / "view 9.jpg").read_bytes())
    (folder / "phone.HEIC").touch()
    warnings = capture_photographs(folder, tmp_path / "out").warnings
    assert any("copy.jpg, view 9.jpg" in warning for warning in warnings)
    assert any("phone.HEIC" in warning for warning in warnings)
    assert len(warnings) == 2


def test_progress_counts_the_photographs(folder, tmp_path):
    calls = []
    capture_photographs(folder, tmp_path / "out", lambda done, total: calls.append((done, total)))
    assert calls == [(0, 3), (1, 3), (2, 3), (3, 3)]
