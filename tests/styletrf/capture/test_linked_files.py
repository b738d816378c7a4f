"""Photographs, masks and poses behind links."""

import shutil

import pytest
from given_cameras import colmap
from made_photographs import encoded, room_poses, texture

from styletrf.capture.mask_files import find_masks
from styletrf.capture.photographs import dangling_links, list_photographs, photographs_below
from styletrf.capture.scene_capture import capture_photographs
from styletrf.capture.user_folders import scene_files
from styletrf.files.linked_folders import walk


@pytest.fixture
def images(tmp_path):
    """The folder of a scene's photographs: one of them in a folder, which a card has as well."""
    for name in ("scene/images/1.png", "scene/images/walk/2.png", "card/3.png", "card/b/4.png"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(encoded(texture(16, 24, seed=int(name[-5])), ".png"))
    return tmp_path / "scene/images"


def names(folder, files):
    return [str(file.relative_to(folder)) for file in files]


def test_photographs_in_a_linked_folder_are_found(images, tmp_path):
    (images / "card").symlink_to(tmp_path / "card")
    files = ["1.png", "card/3.png", "card/b/4.png", "walk/2.png"]
    assert names(images, list_photographs(images)) == files
    assert names(images, scene_files(images)) == files


def test_a_folder_that_links_lead_to_as_well_keeps_its_own_path(images):
    (images / "a").symlink_to(images / "walk")
    (images / "walk/loop").symlink_to(images)
    assert names(images, photographs_below(images)) == ["1.png", "walk/2.png"]
    assert [place for place, _, _ in walk(images)] == [images, images / "walk"]


def test_masks_that_two_folders_share_by_links_mask_the_photographs_of_both(images, tmp_path):
    (images / "card").symlink_to(tmp_path / "card")
    (tmp_path / "black").mkdir()
    for name in ("2.png", "3.png"):
        (tmp_path / "black" / name).touch()
    for folder in (images / "walk", tmp_path / "card"):
        (folder / "masks").symlink_to(tmp_path / "black")
    masked = find_masks(images, photographs_below(images)).by_picture
    assert names(images, masked) == ["card/3.png", "walk/2.png"]


def test_a_link_that_leads_nowhere_has_a_warning(images, tmp_path):
    for name in ("gone.jpg", "notes.txt", "masks/5.png"):
        (images / name).parent.mkdir(exist_ok=True)
        (images / name).symlink_to(tmp_path / "missing")
    (images / "3.png").symlink_to(tmp_path / "card/3.png")
    assert names(images, dangling_links(images)) == ["gone.jpg"]
    (warning,) = capture_photographs(images, tmp_path / "out").warnings
    assert "gone.jpg" in warning


@pytest.mark.parametrize("linked", ["sparse/0", "sparse"])
def test_the_files_of_a_linked_colmap_model_are_files_of_the_scene(tmp_path, linked):
    """They were read, and a changed model led to no new capture."""
    colmap(tmp_path / "scene", room_poses(3))
    link = tmp_path / "scene" / linked
    shutil.move(link, tmp_path / "elsewhere")
    link.symlink_to(tmp_path / "elsewhere")
    files = scene_files(tmp_path / "scene/images")
    assert tmp_path / "scene/sparse/0/images.bin" in files
    assert len(files) == len(set(files))
