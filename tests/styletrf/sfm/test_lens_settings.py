"""Which photographs share a lens, by their sizes, clips, EXIF and directions."""

import numpy as np
import pytest

from styletrf.capture.capture_file import Photograph
from styletrf.sfm.lens_settings import lens_settings


def taken(count, size=(64, 48), **more):
    return [Photograph(str(k), f"{k}.png", *size, 1, "", **more) for k in range(count)]


def settings_of(photographs, focals_px=None, how="auto"):
    files = [str(k) for k in range(len(photographs))]
    return lens_settings(files, photographs, focals_px or [None] * len(files), how)


def groups_of(settings):
    return [[int(file) for file in setting.files] for setting in settings]


@pytest.mark.parametrize(
    ("focals", "how", "groups"),
    [
        ([700.0, 705.0, None, 702.0], "auto", [[0, 1, 2, 3]]),
        ([700.0, 1400.0, 705.0, None, 1410.0, 698.0], "auto", [[0, 2, 3, 5], [1, 4]]),
        ([700.0, 1400.0, 705.0], "one", [[0, 1, 2]]),
        ([None, None], "auto", [[0, 1]]),
        ([700.0, 700.0, None], "each", [[0], [1], [2]]),
    ],
)
def test_photographs_are_grouped_by_the_focal_lengths_that_exif_names(focals, how, groups):
    settings = settings_of(taken(len(focals)), focals, how)
    assert groups_of(settings) == groups
    for group, setting in zip(groups, settings, strict=True):
        priors = [focals[k] for k in group if focals[k]]
        assert setting.focal_prior_px == (pytest.approx(np.median(priors)) if priors else None)


@pytest.mark.parametrize("how", ["auto", "one"])
def test_photographs_of_different_sizes_never_share_a_lens(how):
    sizes = [(64, 48), (48, 64), (64, 48), (32, 24)]
    photographs = [taken(1, size)[0] for size in sizes]
    settings = settings_of(photographs, [None, 50.0, None, None], how)
    assert groups_of(settings) == [[0, 2], [1], [3]]


@pytest.mark.parametrize(
    ("how", "groups"),
    [("auto", [[0, 1, 4], [2, 3]]), ("one", [[0, 1, 2, 3, 4]]), ("each", [[k] for k in range(5)])],
)
def test_two_clips_of_one_size_have_two_lenses_unless_settings_say_otherwise(how, groups):
    """Clips at 1x and 0.5x had one focal length, which bent the poses."""
    wide, tele = taken(2, clip="a.mp4"), taken(2, clip="b.mp4")
    assert groups_of(settings_of([*wide, *tele, *taken(1, clip="a.mp4")], how=how)) == groups


@pytest.mark.parametrize(
    ("photographs", "focals", "how", "assumed"),
    [
        (taken(2), [None, None], "auto", [0, 1]),
        (taken(3), [700.0, None, 700.0], "auto", [1]),
        (taken(2), [700.0, 700.0], "auto", []),
        (taken(2), [None, None], "one", []),
        (taken(2), [700.0, None], "one", []),
        (taken(1), [None], "auto", []),
        (taken(2, clip="a.mp4"), [None, None], "auto", []),
        (taken(2, panorama="p", direction="up"), [30.0, 30.0], "auto", []),
    ],
)
def test_a_lens_is_assumed_of_photographs_that_only_their_size_says_share_it(
    photographs, focals, how, assumed
):
    """Where some had EXIF, the others had their lens whatever the photographs showed."""
    (setting,) = settings_of(photographs, focals, how)
    assert [int(file) for file in setting.assumed] == assumed


def test_photographs_without_exif_join_the_commonest_lens_and_it_alone_is_assumed_of_them():
    settings = settings_of(taken(6), [700.0, 1400.0, 705.0, None, 1410.0, 698.0])
    assert [(setting.files, setting.assumed) for setting in settings] == [
        (("0", "2", "3", "5"), ("3",)),
        (("1", "4"), ()),
    ]


def test_focal_lengths_far_apart_share_no_lens_whatever_lies_between():
    """Each was near enough to the next: 25 focal lengths from 1000 to 1986 px became one lens."""
    focals_px = [1000 * 1.029**k for k in range(25)]
    groups = groups_of(settings_of(taken(25), focals_px))
    assert sorted(k for group in groups for k in group) == [*range(25)]
    for group in groups:
        of_setting = [focals_px[k] for k in group]
        assert max(of_setting) <= 1.03 * min(of_setting)


@pytest.mark.parametrize("how", ["auto", "one", "each"])
def test_views_of_panoramas_have_a_setting_for_each_direction_whatever_their_clips(how):
    directions = ["front", "up", "front", "up", None]
    clips = ["a.mp4", "a.mp4", "b.mp4", "b.mp4", None]
    photographs = [
        taken(1, direction=direction, clip=clip)[0]
        for direction, clip in zip(directions, clips, strict=True)
    ]
    settings = settings_of(photographs, [30.0] * 4 + [31.0], how)
    assert [(s.files, s.focal_prior_px, s.direction) for s in settings] == [
        (("0", "2"), 30.0, "front"),
        (("1", "3"), 30.0, "up"),
        (("4",), 31.0, None),
    ]
