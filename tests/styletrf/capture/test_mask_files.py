import pytest
from hypothesis import given
from hypothesis import strategies as st

from styletrf.capture.mask_files import find_clip_masks, find_masks, mask_files
from styletrf.capture.photographs import VIDEO_SUFFIXES, files_below, photographs_below


@pytest.fixture
def images(tmp_path):
    (tmp_path / "images").mkdir()
    return tmp_path / "images"


def found(images, photographs, masks):
    """What is found of files in `images` and beside it: masks by photographs, and the others."""
    put(images, photographs, masks)
    return named(images, find_masks(images, photographs_below(images)))


def found_of_clips(images, clips, masks):
    """What is found of clips in `images` and files beside it."""
    put(images, clips, masks)
    return named(images, find_clip_masks(images, files_below(images, VIDEO_SUFFIXES)))


def put(images, pictures, masks):
    for name in [*(f"images/{picture}" for picture in pictures), *masks]:
        (images.parent / name).parent.mkdir(parents=True, exist_ok=True)
        (images.parent / name).touch()


def named(images, result):
    """The masks by their photographs or clips, and the others, by their paths."""
    fits = {
        str(picture.relative_to(images)): str(mask.relative_to(images.parent))
        for picture, mask in result.by_picture.items()
    }
    return fits, [str(mask.relative_to(images.parent)) for mask in result.unused]


@pytest.mark.parametrize(
    "mask",
    [
        "masks/walk/IMG_1.png",
        "masks/walk/IMG_1.PNG",
        "masks/walk/IMG_1.JPG.png",
        "masks/walk/IMG_1.jpg.Png",
        "Masks/walk/IMG_1.png",
        "images/masks/walk/IMG_1.png",
        "images/walk/masks/IMG_1.png",
        "masks/IMG_1.png",
        "masks/IMG_1.jpg.PNG",
    ],
)
def test_a_mask_is_found_where_it_can_be_of_one_photograph_only(images, mask):
    photographs = ["walk/IMG_1.JPG", "walk/IMG_2.JPG"]
    assert found(images, photographs, [mask]) == ({"walk/IMG_1.JPG": mask}, [])


@pytest.mark.parametrize(
    ("photographs", "masks"),
    [
        (["a/1.jpg", "b/1.jpg"], ["masks/1.png"]),
        (["a/1.jpg"], ["masks/1.png", "masks/c/1.png"]),
        (["a/1.jpg", "b/2.jpg"], ["masks/b/1.png"]),
        (["a/1.jpg"], ["masks/gone/1.png"]),
        (["2.jpg", "a/1.jpg"], ["masks/1.png"]),
        (["1.jpg"], ["masks/IMG_1.png", "masks/1.jpg"]),
        (["img_1.jpg"], ["masks/IMG_1.png"]),
    ],
    ids=[
        "two photographs",
        "two masks",
        "other folder",
        "folder that is gone",
        "same folder",
        "other name",
        "other case",
    ],
)
def test_a_mask_that_may_be_of_another_photograph_fits_none(images, photographs, masks):
    assert found(images, photographs, masks) == ({}, masks)


def test_photographs_without_folders_have_masks_in_any(images):
    fits, unused = found(images, ["1.jpg", "2.jpg"], ["masks/walk/2.png"])
    assert (fits, unused) == ({"2.jpg": "masks/walk/2.png"}, [])


@pytest.mark.parametrize("photograph", ["caf\u00e9/\u00e9.jpg", "cafe\u0301/e\u0301.jpg"])
@pytest.mark.parametrize("mask", ["masks/caf\u00e9/e\u0301.png", "masks/cafe\u0301/\u00e9.jpg.png"])
def test_a_mask_is_found_however_its_accents_are_stored(images, photograph, mask):
    assert found(images, [photograph, "2.jpg"], [mask]) == ({photograph: mask}, [])


def test_the_mask_in_the_same_folder_comes_first(images):
    masks = ["masks/1.png", "masks/a/1.png", "masks/b/1.jpg.png"]
    fits, unused = found(images, ["a/1.jpg", "b/1.jpg"], masks)
    assert fits == {"a/1.jpg": "masks/a/1.png", "b/1.jpg": "masks/b/1.jpg.png"}
    assert unused == ["masks/1.png"]


def test_the_suffix_tells_photographs_of_one_name_apart(images):
    fits, unused = found(images, ["a/1.jpg", "b/1.png"], ["masks/1.jpg.png"])
    assert (fits, unused) == ({"a/1.jpg": "masks/1.jpg.png"}, [])


def test_what_is_no_mask_of_the_scene_is_passed_over(images):
    others = ["masks/notes.txt", "masks/._1.png", "images/images_4/masks/1.png", "mask/1.png"]
    assert found(images, ["1.jpg"], others) == ({}, [])
    assert mask_files(images) == {}


def test_a_scene_called_masks_holds_no_masks_of_another(tmp_path):
    (tmp_path / "scenes/masks").mkdir(parents=True)
    (tmp_path / "scenes/yard").mkdir()
    for name in ("masks/1.png", "yard/1.jpg"):
        (tmp_path / "scenes" / name).touch()
    assert mask_files(tmp_path / "scenes/yard") == {}


@pytest.mark.parametrize(
    ("files", "mask"),
    [
        (["masks/day/a.mp4"], "masks/day/a.mp4"),
        (["masks/day/a.WEBM"], "masks/day/a.WEBM"),
        (["masks/day/a.mov.mkv"], "masks/day/a.mov.mkv"),
        (["masks/a.mp4"], "masks/a.mp4"),
        (["images/day/masks/a.mp4"], "images/day/masks/a.mp4"),
        (["masks/day/a/1.png", "masks/day/a/2.PNG"], "masks/day/a"),
        (["masks/day/a.MOV/1.png"], "masks/day/a.MOV"),
        (["masks/a/1.png"], "masks/a"),
    ],
)
def test_the_mask_of_a_clip_is_a_video_or_a_folder_of_png_files_of_its_name(images, files, mask):
    assert found_of_clips(images, ["day/a.MOV", "day/b.mov"], files) == ({"day/a.MOV": mask}, [])


@pytest.mark.parametrize(
    ("clips", "masks"),
    [
        (["a.mp4"], ["masks/b.mp4", "masks/b/1.png"]),
        (["a.mp4"], ["masks/1.png", "masks/a.png"]),
        (["a.mp4"], ["masks/a/1.jpg", "masks/a/b/1.png"]),
        (["walk.mp4"], ["images/walk/masks/1.png"]),
        (["day/a.mp4", "night/a.mp4"], ["masks/a.mp4"]),
        (["day/a.mp4"], ["masks/dusk/a.mp4"]),
        (["a.mp4", "a.mov"], ["masks/a.webm", "masks/a/1.png"]),
    ],
    ids=[
        "other name",
        "no folder",
        "no PNG",
        "folder of a clip",
        "two clips",
        "other folder",
        "other suffix of two clips",
    ],
)
def test_what_may_mask_another_clip_or_none_fits_none(images, clips, masks):
    assert found_of_clips(images, clips, masks) == ({}, sorted(masks, key=sorting))


@pytest.mark.parametrize("of_mp4", ["masks/a.mp4", "masks/a.mp4.webm", "masks/a.mp4/1.png"])
def test_clips_whose_suffixes_alone_differ_have_masks_with_their_whole_names(images, of_mp4):
    """Both had the mask of the one."""
    mask = "masks/a.mp4" if of_mp4.endswith(".png") else of_mp4
    clips = ["a.mov", "a.mp4"]
    assert found_of_clips(images, clips, [of_mp4]) == ({"a.mp4": mask}, [])
    both = {"a.mp4": mask, "a.mov": "masks/a.mov"}
    assert found_of_clips(images, clips, [of_mp4, "masks/a.mov"]) == (both, [])


def sorting(mask):
    """PNG files come first."""
    return not mask.endswith(".png"), mask


def test_a_video_masks_no_photograph_and_a_file_in_a_folder_is_of_its_folder_alone(images):
    masks = ["masks/1/1.png", "masks/1.mp4"]
    assert found(images, ["1.jpg", "2/1.jpg"], masks) == ({}, masks)


NAMES = st.sampled_from(["1.jpg", "1.png", "2.JPG", "a/1.jpg", "a/2.png", "b/1.jpg", "b/c/3.jpg"])


@given(st.sets(NAMES, min_size=1), st.sets(NAMES))
def test_every_mask_fits_a_photograph_or_is_unused(tmp_path_factory, photographs, masks):
    images = tmp_path_factory.mktemp("scene") / "images"
    fits, unused = found(images, photographs, [f"masks/{mask}" for mask in masks])
    assert {*fits.values()}.isdisjoint(unused)
    assert {*fits.values(), *unused} == {f"masks/{mask}" for mask in masks}
