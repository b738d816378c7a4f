"""The report on poses names one photograph's lens, before and after it was found."""

import numpy as np
import pycolmap
import pytest
from message_words import mentions

from styletrf.capture.capture_file import Photograph
from styletrf.geometry.undistortion import pinhole_for
from styletrf.sfm.colmap_images import ColmapImages
from styletrf.sfm.lens_settings import LensSetting
from styletrf.sfm.mapping import ENOUGH_EXPLAINED, SfmResult
from styletrf.sfm.poses_report import poses_report
from styletrf.sfm.reconstruction import PlacedPhotograph

PHOTOGRAPHS = [Photograph(name, f"{name}.jpg", 6000, 4000, 1, "") for name in "abc"]


def reported(folder, file="0.png", explained=1.0, *, is_given=False):
    """The report on three photographs, of which `a` has a camera and is this file."""
    settings = [(("0.png",), 100.0), (("1.png",), 200.0), (("2.png",), None)]
    lenses = tuple(LensSetting(files, focal_px) for files, focal_px in settings)
    images = ColmapImages(folder, ("0.png", "1.png", "2.png"), 64, lenses, None, ())
    lens = pycolmap.Camera(model="PINHOLE", width=64, height=48, params=[210, 210, 32, 24])
    camera = pinhole_for(lens, "a", np.eye(3, 4))
    placed = [PlacedPhotograph(file, pycolmap.Image(), lens, camera)]
    mapping = SfmResult([pycolmap.Reconstruction()], "exhaustive", 3, "global", "", explained)
    return poses_report(
        images, PHOTOGRAPHS, mapping, placed, 0.0, has_parallax=True, is_given=is_given
    )


@pytest.mark.parametrize(
    ("file", "prior_px"), [("0.png", 100.0), ("1.png", 200.0), ("2.png", None)]
)
def test_the_prior_is_that_of_the_photograph_whose_focal_length_is_found(tmp_path, file, prior_px):
    """It was that of the first photograph, also where this could not be placed."""
    report = reported(tmp_path, file)
    assert (report.focal_prior_px, report.focal_px) == (prior_px, 210)
    assert report.lens_settings == 3


def test_sizes_are_those_of_the_placed_photographs_as_they_came(tmp_path):
    """Their reduced copies have one longer side, whatever cameras they are from."""
    assert reported(tmp_path).photograph_sizes == {"a": (6000, 4000)}


@pytest.mark.parametrize("is_given", [False, True])
def test_poses_that_explain_too_little_are_doubted_wherever_they_come_from(tmp_path, is_given):
    """Given ones were believed if they explained a third of what the photographs share."""
    enough = reported(tmp_path, explained=ENOUGH_EXPLAINED, is_given=is_given)
    assert enough.doubts == ()
    (doubt,) = reported(tmp_path, explained=0.4, is_given=is_given).doubts
    assert mentions(doubt, "40%")
    assert ("solved" in doubt) == is_given
