from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from styletrf.capture.photograph_names import (
    composed,
    distinct,
    photograph_names,
    shortened,
    stored_files,
)

PARTS = st.sampled_from(["a", "A", "b", "1", "a_1", "1_1", "1_2", "a_1_1", "a_1_1_2"])
FILES = st.builds(
    lambda folders, stem, suffix: Path("scene", *folders, stem + suffix),
    st.lists(PARTS, max_size=3),
    PARTS,
    st.sampled_from([".jpg", ".JPG", ".png", ".jpg.png", ""]),
)


def caseless(names):
    return {name.casefold() for name in names}


@given(st.lists(FILES, unique=True, min_size=1, max_size=12))
def test_no_two_photographs_have_one_name_whatever_their_paths(files):
    stored = stored_files(files)
    assert len(caseless(stored)) == len(files)
    assert len(caseless(photograph_names(stored))) == len(files)


@pytest.mark.parametrize(
    ("files", "stored", "names"),
    [
        (["a/1.jpg", "b/2.jpg"], ["1.jpg", "2.jpg"], ["1", "2"]),
        (["a/1.jpg", "b/1.jpg"], ["a_1.jpg", "b_1.jpg"], ["a_1", "b_1"]),
        (["1.jpg", "1.png"], ["1.jpg", "1.png"], ["1.jpg", "1.png"]),
        (["a/1.jpg", "b/1.jpg", "2.jpg"], ["a_1.jpg", "b_1.jpg", "2.jpg"], ["a_1", "b_1", "2"]),
    ],
)
def test_names_are_as_short_as_tells_the_photographs_apart(files, stored, names):
    assert stored_files([Path("scene", file) for file in files]) == stored
    assert photograph_names(stored) == names


def test_a_folder_and_an_underscore_give_different_names():
    """Both were `a_1_1.jpg`, and one photograph overwrote the other."""
    files = ["a/1_1.jpg", "a_1/1.jpg", "b/1.jpg"]
    stored = stored_files([Path("scene", file) for file in files])
    assert stored == ["a_1_1.jpg", "a_1_1_2.jpg", "b_1.jpg"]


def test_a_number_is_none_that_another_name_has():
    assert distinct(["a", "a_2", "A", "a", "b"]) == ["a", "a_2", "A_3", "a_4", "b"]


LONG = st.text("a1.é京", min_size=120, max_size=251).filter(lambda name: len(name.encode()) <= 251)


@given(st.lists(st.lists(LONG, min_size=1, max_size=3), min_size=1, max_size=5))
def test_names_of_long_files_and_folders_leave_room_for_suffixes_and_stay_apart(paths):
    """Folders before the names of files made names that no file system takes."""
    files = [Path("scene", *parts[:-1], f"{parts[-1]}.jpg") for parts in paths]
    files = [Path("scene", str(k), *file.parts[1:]) for k, file in enumerate(files)]
    stored = stored_files(files)
    assert len(caseless(stored)) == len(files)
    assert max(len(name.encode()) for name in stored) <= 210
    assert all(name.endswith(".jpg") for name in stored)
    assert all(len(name.encode()) < 231 for name in photograph_names(stored))


@given(st.text(max_size=300))
def test_a_shortened_name_is_the_end_of_the_name(name):
    assert name.endswith(shortened(name))
    assert (shortened(name) == name) == (len(name.encode()) <= 200)


def test_a_name_reads_alike_however_its_accents_are_stored():
    assert composed("cafe\u0301") == composed("caf\u00e9") == "caf\u00e9"
