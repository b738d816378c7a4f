import os
import unicodedata
from pathlib import Path

import pytest
from expected_errors import rejects

from styletrf.capture.user_folders import (
    find_content,
    find_scene,
    find_style,
    masks_of_videos,
    scene_files,
    scene_videos,
    skipped_photographs,
    skipped_videos,
)
from styletrf.errors import InputError


@pytest.fixture
def data(tmp_path):
    for scene in ("garden10", "garden9"):
        (tmp_path / "scenes" / scene / "images").mkdir(parents=True)
    (tmp_path / "scenes" / "empty").mkdir()
    (tmp_path / "styles").mkdir()
    for style in ("waves.jpg", "dots.PNG", "both.jpg", "both.png", "note.txt", ".hidden.jpg"):
        (tmp_path / "styles" / style).touch()
    return tmp_path


def test_a_scene_or_style_that_exists_is_found_by_its_name(data):
    assert find_scene(data, "garden9") == data / "scenes/garden9/images"
    assert find_style(data, "waves") == data / "styles/waves.jpg"
    assert find_style(data, "dots") == data / "styles/dots.PNG"
    assert find_style(data, "both.png") == data / "styles/both.png"


@pytest.mark.parametrize("find", [find_scene, find_style])
@pytest.mark.parametrize(
    "name", ["", ".", "..", "a/b", "/etc", "../x", ".hidden", "a..b", "a\\b", "a\nb", "a\0"]
)
def test_names_that_leave_the_folder_are_refused(data, find, name):
    with rejects(repr(name), "'..'"):
        find(data, name)


@pytest.mark.parametrize("name", ["nowhere", "empty"])
def test_a_missing_scene_is_answered_with_those_that_exist(data, name):
    with rejects(name, "garden9, garden10") as refusal:
        find_scene(data, name)
    assert f"scenes/{name}" in refusal.value.remedy


@pytest.mark.parametrize(
    "place", [b"caf\xe9.mp4", b"caf\xe9.nef", b"caf\xe9/1.jpg", b"images/masks/caf\xe9/1.png"]
)
def test_a_file_of_a_scene_whose_path_is_not_utf8_is_refused(data, place):
    """Its name could not be written into the warnings or the key."""
    for name in (*(b"images/%d.jpg" % index for index in range(3)), b"images/" + place):
        file = data / "scenes/empty" / os.fsdecode(name)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    with rejects(Path(place.replace(b"images/masks/", b"").decode(errors="replace")), "UTF-8"):
        scene_files(find_scene(data, "empty"))


@pytest.mark.parametrize("find", [find_scene, find_style])
def test_a_name_that_is_not_utf8_is_refused_before_its_folder_is_read(data, find):
    """A page with the name could not be written at the end."""
    name = os.fsdecode(b"caf\xe9")
    for index in range(3):
        file = data / "scenes" / name / f"images/{index}.jpg"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    with rejects("caf\ufffd", "UTF-8"):
        find(data, name)


def test_the_scenes_that_exist_are_listed_by_the_names_that_find_them(data):
    """A folder with a dot in its name was listed without what is behind the dot."""
    for file in ("house.2024/1.jpg", "house.2024/2.jpg", "house.2024/3.jpg", "walk.v2.mp4"):
        (data / "scenes" / file).parent.mkdir(exist_ok=True)
        (data / "scenes" / file).touch()
    with pytest.raises(InputError) as refusal:
        find_scene(data, "hause")
    for name, found in (("house.2024", "house.2024"), ("walk.v2", "walk.v2.mp4")):
        assert f" {name}" in refusal.value.problem
        assert find_scene(data, name) == data / "scenes" / found


def test_a_video_is_found_by_its_name_with_or_without_its_suffix(data):
    """It was counted twice, as the video of a folder and as the one beside it."""
    (data / "scenes/walk.mp4").touch()
    assert find_scene(data, "walk.mp4") == find_scene(data, "walk") == data / "scenes/walk.mp4"
    assert skipped_photographs(data, "walk.mp4") == skipped_videos(data, "walk.mp4") == []
    mask = data / "scenes/walk/masks/walk.mp4"
    mask.parent.mkdir(parents=True)
    mask.touch()
    assert masks_of_videos(data, "walk.mp4") == masks_of_videos(data, "walk")
    assert masks_of_videos(data, "walk").by_picture == {data / "scenes/walk.mp4": mask}


def test_a_scene_called_images_is_refused(data):
    """The poses and masks of all scenes were taken for its own."""
    for index in range(3):
        file = data / f"scenes/images/{index}.jpg"
        file.parent.mkdir(exist_ok=True)
        file.touch()
    with rejects("'images'", "folder", remedy=["Rename"]):
        find_scene(data, "images")


def test_photographs_may_lie_in_the_scenes_own_folder(data):
    (data / "scenes" / "empty" / "1.JPG").touch()
    assert find_scene(data, "empty") == data / "scenes/empty"


@pytest.mark.parametrize("place", ["walk.mp4", "walk/film.MOV", "walk/images/film.webm"])
def test_a_video_is_a_scene(data, place):
    video = data / "scenes" / place
    video.parent.mkdir(parents=True, exist_ok=True)
    video.touch()
    assert find_scene(data, "walk") == video
    with rejects("nowhere", "garden10, walk"):
        find_scene(data, "nowhere")


@pytest.mark.parametrize("names", [("empty.mp4", "empty/a.mov"), ("empty.mp4", "empty.webm")])
def test_two_videos_that_may_be_two_scenes_are_not_guessed_between(data, names):
    for name in names:
        (data / "scenes" / name).touch()
    listed = ", ".join(sorted(Path(name).name for name in names))
    with rejects("empty", listed):
        find_scene(data, "empty")


@pytest.mark.parametrize("place", ["empty", "garden9/images"])
def test_the_videos_of_a_folder_are_one_scene(data, place):
    folder = data / "scenes" / place
    for name in ("clip10.mp4", "clip9.MOV", ".hidden.mp4", "notes.txt"):
        (folder / name).touch()
    found = find_scene(data, place.partition("/")[0])
    assert found == folder
    assert [video.name for video in scene_videos(found)] == ["clip9.MOV", "clip10.mp4"]
    assert scene_files(found) == scene_videos(found)
    for name in "123":
        (folder / f"{name}.jpg").touch()
    assert scene_videos(found) == []


@pytest.mark.parametrize("poses", [[], ["transforms.json"]])
def test_all_masks_are_files_of_a_scene_so_that_one_renamed_is_looked_at_again(data, poses):
    scene = data / "scenes/garden9"
    photographs = [scene / "images" / f"{name}.jpg" for name in "abc"]
    masks = [scene / "masks" / name for name in ("a.png", "misspelled.png", "video.mp4")]
    masks[0].parent.mkdir()
    for file in [*photographs, *masks]:
        file.touch()
    for name in poses:
        (scene / name).write_text('{"frames": []}')
    files = scene_files(scene / "images")
    assert files == [*photographs, *masks, *(scene / name for name in poses)]


@pytest.mark.parametrize(
    ("video", "mask"),
    [
        ("walk.mp4", "walk/masks/walk.webm"),
        ("walk.mp4", "walk/masks/walk/1.png"),
        ("walk/film.MOV", "walk/Masks/film/0001.PNG"),
        ("walk/images/film.webm", "walk/masks/film.webm"),
        ("walk/images/day/film.webm", "walk/images/day/masks/film.mp4"),
    ],
)
def test_a_video_has_the_mask_of_its_name_wherever_it_lies(data, video, mask):
    for name in (video, mask):
        (data / "scenes" / name).parent.mkdir(parents=True, exist_ok=True)
        (data / "scenes" / name).touch()
    assert find_scene(data, "walk") == data / "scenes" / video
    found, file = masks_of_videos(data, "walk"), data / "scenes" / mask
    whole = file.parent if file.suffix.lower() == ".png" else file
    assert (found.by_picture, found.files) == ({data / "scenes" / video: whole}, (file,))
    assert found.unused == ()


def test_a_scene_called_masks_does_not_mask_a_video(data):
    for name in ("masks/1.png", "walk.mp4"):
        (data / "scenes" / name).parent.mkdir(exist_ok=True)
        (data / "scenes" / name).touch()
    assert find_scene(data, "walk") == data / "scenes/walk.mp4"
    assert masks_of_videos(data, "walk").files == ()


def test_a_video_beside_photographs_is_passed_over(data):
    for name in ("a.mov", "day/1.jpg", "day/2.jpg", "evening/3.jpg"):
        (data / "scenes/empty" / name).parent.mkdir(exist_ok=True)
        (data / "scenes/empty" / name).touch()
    assert find_scene(data, "empty") == data / "scenes/empty"
    assert scene_videos(data / "scenes/empty") == []


def test_videos_are_skipped_wherever_they_lie_beside_photographs(data):
    videos = ["garden9/images/a.mov", "garden9/b.mp4", "garden9/clips/c.webm", "garden9.mkv"]
    for name in (*videos, "garden9/images/1.jpg", "garden9/images/2.jpg", "garden9/images/3.jpg"):
        (data / "scenes" / name).parent.mkdir(exist_ok=True)
        (data / "scenes" / name).touch()
    assert set(skipped_videos(data, "garden9")) == {data / "scenes" / name for name in videos}
    (data / "scenes/garden10/images/a.mov").touch()
    assert skipped_videos(data, "garden10") == [], "it is the scene"


def test_a_clip_in_images_is_the_scene_whatever_pictures_lie_elsewhere(data):
    for name in ("images/clip.mp4", "renders/1.png", "renders/2.png", "renders/3.png"):
        (data / "scenes/garden9" / name).parent.mkdir(exist_ok=True)
        (data / "scenes/garden9" / name).touch()
    assert find_scene(data, "garden9") == data / "scenes/garden9/images/clip.mp4"
    assert skipped_photographs(data, "garden9") == []


def test_a_picture_beside_a_video_is_no_capture(data):
    for name in ("a.mov", "cover.jpg"):
        (data / "scenes/empty" / name).touch()
    assert find_scene(data, "empty") == data / "scenes/empty/a.mov"
    assert skipped_photographs(data, "empty") == [data / "scenes/empty/cover.jpg"]


def test_videos_lie_in_folders_and_beside_an_empty_folder_of_images(data):
    for name in ("card1/clip.mp4", "card2/clip.mp4"):
        (data / "scenes/garden9" / name).parent.mkdir()
        (data / "scenes/garden9" / name).touch()
    found = find_scene(data, "garden9")
    assert [video.parent.name for video in scene_videos(found)] == ["card1", "card2"]


@pytest.mark.parametrize("name", ["IMG_1.dng", "card/IMG_1.dng"])
def test_a_folder_of_raw_files_is_answered_with_what_to_do(data, name):
    """It was said that there is no such scene."""
    file = data / "scenes/raw" / name
    file.parent.mkdir(parents=True)
    file.touch()
    with rejects("raw", ".dng", data / "scenes/raw"):
        find_scene(data, "raw")


def test_a_public_scene_is_answered_with_its_archive(data):
    with rejects("fern", "garden9") as refusal:
        find_scene(data, "fern")
    assert "nerf_llff_data.zip" in refusal.value.remedy
    assert str(data) in refusal.value.remedy


def test_a_missing_style_is_answered_with_those_that_exist(data):
    with rejects("nothing", "style", "both, dots, waves"):
        find_style(data, "nothing")


def test_a_text_file_is_no_style(data):
    with rejects("note", "note.txt"):
        find_style(data, "note")


def test_two_images_of_one_name_are_not_guessed_between(data):
    with rejects("both", "both.jpg, both.png"):
        find_style(data, "both")


def test_names_are_found_however_their_accents_are_stored(tmp_path):
    """macOS stores an accent apart from its letter, and keyboards type both as one."""
    stored, typed = (unicodedata.normalize(form, "\xe9t\xe9") for form in ("NFD", "NFC"))
    files = [tmp_path / f"scenes/{stored}/images/{k}.jpg" for k in range(3)]
    for file in (*files, tmp_path / f"scenes/2{stored}.mp4", tmp_path / f"styles/{stored}.png"):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    assert find_scene(tmp_path, typed) == files[0].parent
    assert find_scene(tmp_path, f"2{typed}") == tmp_path / f"scenes/2{stored}.mp4"
    for name in (typed, stored, f"{typed}.png"):
        assert find_style(tmp_path, name) == tmp_path / f"styles/{stored}.png"


def test_of_names_that_differ_in_stored_accents_only_the_typed_one_is_meant(tmp_path):
    """No name led to any: each was that of several files."""
    for form in ("NFC", "NFD"):
        name = unicodedata.normalize(form, "\xe9t\xe9")
        for file in (f"styles/{name}.png", f"scenes/{name}.mp4"):
            (tmp_path / file).parent.mkdir(exist_ok=True)
            (tmp_path / file).touch()
    for form in ("NFC", "NFD"):
        name = unicodedata.normalize(form, "\xe9t\xe9")
        assert find_scene(tmp_path, name) == tmp_path / f"scenes/{name}.mp4"
        for typed in (name, f"{name}.png"):
            assert find_style(tmp_path, typed) == tmp_path / f"styles/{name}.png"


def test_a_scene_that_has_the_typed_name_is_found_without_a_look_at_others(data, monkeypatch):
    for name in "123":
        (data / f"scenes/garden9/images/{name}.jpg").touch()
    looked_at, is_dir = [], Path.is_dir

    def noted(path, **options):
        looked_at.append(path)
        return is_dir(path, **options)

    monkeypatch.setattr(Path, "is_dir", noted)
    find_scene(data, "garden9")
    assert not {data / "scenes/garden10", data / "scenes/empty"} & set(looked_at)


def test_no_data_at_all_is_an_error(tmp_path):
    with rejects("garden", "none"):
        find_scene(tmp_path, "garden")
    with rejects("waves", "none"):
        find_style(tmp_path, "waves")


@pytest.fixture
def content(tmp_path):
    (tmp_path / "content").mkdir()
    for name in ("README.txt", ".fetched/x/a.jpg", "annotations/notes.txt"):
        (tmp_path / "content" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "content" / name).touch()
    return tmp_path / "content"


@pytest.mark.parametrize("name", ["photos/sub/a.JPG", "train.zip", "instances.json"])
def test_the_usual_content_is_what_can_be_content(content, name):
    assert find_content(content.parent, "auto") is None
    (content / name).parent.mkdir(parents=True, exist_ok=True)
    (content / name).touch()
    found = content / name.partition("/")[0]
    assert find_content(content.parent, "auto") == found
    assert find_content(content.parent, found.name) == found
    assert find_content(content.parent, "embedded") is None


def test_images_that_lie_in_the_folder_itself_are_the_content(content):
    (content / "a.jpg").touch()
    assert find_content(content.parent, "auto") == content


def test_several_contents_are_not_guessed_between(content):
    (content / "train.zip").touch()
    (content / "val.zip").touch()
    with rejects("--content auto", "train.zip", "val.zip", remedy=["--content", "train.zip"]):
        find_content(content.parent, "auto")


def test_content_elsewhere_is_a_path(content, tmp_path):
    assert find_content(content.parent, str(tmp_path)) == tmp_path


def test_no_content_folder_is_no_content(tmp_path):
    assert find_content(tmp_path, "auto") is None
