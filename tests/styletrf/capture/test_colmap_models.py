"""Which of a scene's COLMAP models is read."""

import shutil

import pytest
from expected_errors import rejects
from given_cameras import BENT, VIEWS, colmap, photographed
from made_photographs import room_poses

from styletrf.capture.poses.colmap_model import colmap_views
from styletrf.capture.poses.pose_formats import find_given_poses

POSES = room_poses(VIEWS)


def model(folder, name, poses):
    """Writes a model of so many photographs as `sparse/NAME`, without the photographs."""
    colmap(folder, poses)
    shutil.rmtree(folder / "images")
    if name != "0":
        (folder / "sparse/0").rename(folder / "sparse" / name)


def test_of_several_models_the_largest_is_read(tmp_path):
    """COLMAP's model 0 need not be it: a capture of 20 became one of 3."""
    model(tmp_path, "1", POSES)
    model(tmp_path, "0", POSES[:3])
    photographed(tmp_path, BENT, POSES)
    found = find_given_poses(tmp_path)
    assert found is not None
    assert (found.source, len(found.views)) == (tmp_path / "sparse/1", VIEWS)


def test_a_model_of_photographs_that_are_gone_is_not_the_largest(tmp_path):
    model(tmp_path, "1", POSES)
    model(tmp_path, "0", POSES[:4])
    photographed(tmp_path, BENT, POSES[:4])
    found = find_given_poses(tmp_path)
    assert found is not None
    assert len(found.views) == 4


def test_views_are_in_the_natural_order_of_their_photographs(tmp_path):
    """10 came before 9, so that a way along the photographs went to and fro."""
    colmap(tmp_path, POSES[:3], text=True)
    table = tmp_path / "sparse/0/images.txt"
    table.write_text(table.read_text().replace(" 1.png", " 10.png").replace(" 2.png", " 9.png"))
    for before, after in (("1.png", "10.png"), ("2.png", "9.png")):
        (tmp_path / "images" / before).rename(tmp_path / "images" / after)
    found = find_given_poses(tmp_path)
    assert found is not None
    for views in (found.views, colmap_views(tmp_path / "sparse/0", tmp_path)):
        assert [view.file.name for view in views] == ["0.png", "9.png", "10.png"]


@pytest.mark.parametrize("name", ["0_old", "1"])
def test_a_backup_and_a_model_that_is_garbage_are_passed_over(tmp_path, name):
    model(tmp_path, name, POSES)
    (tmp_path / "sparse" / name / "images.bin").write_bytes(b"garbage")
    model(tmp_path, "0", POSES[:4])
    photographed(tmp_path, BENT, POSES[:4])
    found = find_given_poses(tmp_path)
    assert found is not None
    assert found.source == tmp_path / "sparse/0"


def test_a_colmap_model_that_is_garbage_is_refused(tmp_path):
    colmap(tmp_path, POSES[:3])
    (tmp_path / "sparse" / "0" / "images.bin").write_bytes(b"garbage")
    with rejects(tmp_path / "sparse" / "0", "COLMAP"):
        find_given_poses(tmp_path)
