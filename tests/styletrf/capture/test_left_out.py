from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from message_words import mentions

from styletrf.capture.left_out import without
from styletrf.capture.photograph_names import photograph_names, stored_files
from styletrf.errors import InputError

FOLDER = Path("scene/images")


def left(files, *leave_out):
    """The photographs of these that are not left out."""
    found = without(FOLDER, [FOLDER / file for file in files], leave_out)
    return [str(file.relative_to(FOLDER)) for file in found]


@pytest.mark.parametrize(
    ("files", "leave_out", "expected"),
    [
        (["IMG [1].jpg", "IMG 1.jpg"], "IMG [1].jpg", ["IMG 1.jpg"]),
        (["IMG [1].jpg", "IMG 1.jpg"], "IMG [1]", ["IMG 1.jpg"]),
        (["IMG 1.jpg", "IMG 2.jpg"], "IMG [1].jpg", ["IMG 2.jpg"]),
        (["1.jpg", "b/1.jpg"], "1", ["b/1.jpg"]),
        (["IMG*.jpg", "IMG2.jpg"], "IMG*", ["IMG2.jpg"]),
        (["a/1.jpg", "b/1.jpg"], "a/1.jpg", ["b/1.jpg"]),
        (["a/1.jpg", "b/1.jpg"], "a/1", ["b/1.jpg"]),
        (["a/1.jpg", "b/1.jpg"], "a_1", ["b/1.jpg"]),
        (["a/1.jpg", "b/1.jpg", "2.jpg"], "1", ["2.jpg"]),
        (["a/1.jpg", "a/2.jpg", "b/1.jpg"], "a/*", ["b/1.jpg"]),
        (["a/1.jpg", "a/2.jpg", "b/1.jpg"], "1*", ["a/2.jpg"]),
        (["1.jpg", "1.png"], "1.png", ["1.jpg"]),
    ],
)  # fmt: skip
def test_a_name_comes_before_a_path_and_a_path_before_a_pattern(files, leave_out, expected):
    assert left(files, leave_out) == expected


PARTS = st.text("ab[]*?!.1", min_size=1).filter(lambda part: part.strip("."))
FILES = st.lists(st.lists(PARTS, min_size=1, max_size=3).map("/".join), unique=True, min_size=1)


@given(FILES, st.data())
def test_every_photograph_can_be_left_out_alone_by_its_path(files, data):
    paths = [f"{file}.jpg" for file in files]
    file = data.draw(st.sampled_from([path for path in paths if "/" in path] or [None]))
    if file:
        assert left(paths, file) == [path for path in paths if path != file]


@given(FILES, st.data())
def test_every_photograph_can_be_left_out_alone_by_its_name_in_the_capture(files, data):
    paths = [f"{file}.jpg" for file in files]
    names = photograph_names(stored_files([FOLDER / path for path in paths]))
    index = data.draw(st.integers(0, len(paths) - 1))
    assert left(paths, names[index]) == [*paths[:index], *paths[index + 1 :]]


@pytest.mark.parametrize("leave_out", ["c/1.jpg", "viwe", "IMG [3].jpg", "A_1"])
def test_an_unknown_name_is_refused_with_the_names_there_are(leave_out):
    with pytest.raises(InputError) as refusal:
        left(["a/1.jpg", "b/1.jpg", "IMG 2.jpg"], "IMG*", leave_out)
    assert leave_out in refusal.value.subject
    assert mentions(refusal.value.remedy, "a_1", "b_1", "IMG 2")


@pytest.mark.parametrize("asked", ["caf\u00e91", "cafe\u03011", "caf\u00e91.jpg", "caf\u00e9*"])
@pytest.mark.parametrize("stored", ["caf\u00e91.jpg", "cafe\u03011.jpg"])
def test_a_photograph_is_left_out_however_its_accents_are_stored(asked, stored):
    """Names from macOS, whose accents are letters of their own, were not found."""
    assert left([stored, "2.jpg"], asked) == ["2.jpg"]
