"""The report on poses names one photograph's lens, before and after it was found."""

import numpy as np
import pycolmap
import pytest

from styletrf.geometry.undistortion import pinhole_for
from styletrf.sfm.colmap_images import ColmapImages
from styletrf.sfm.lens_settings import LensSetting
from styletrf.sfm.mapping import SfmResult
from styletrf.sfm.poses_report import poses_report
from styletrf.sfm.reconstruction import PlacedPhotograph


@pytest.mark.parametrize(
    ("file", "prior_px"), [("0.png", 100.0), ("1.png", 200.0), ("2.png", None)]
)
def test_the_prior_is_that_of_the_photograph_whose_focal_length_is_found(tmp_path, file, prior_px):
    """It was that of the first photograph, also where this could not be placed."""
    settings = [(("0.png",), 100.0), (("1.png",), 200.0), (("2.png",), None)]
    lenses = tuple(LensSetting(files, focal_px) for files, focal_px in settings)
    images = ColmapImages(tmp_path, ("0.png", "1.png", "2.png"), 64, lenses, None, ())
    lens = pycolmap.Camera(model="PINHOLE", width=64, height=48, params=[210, 210, 32, 24])
    camera = pinhole_for(lens, "a", np.eye(3, 4))
    placed = [PlacedPhotograph(file, pycolmap.Image(), lens, camera)]
    mapping = SfmResult([pycolmap.Reconstruction()], "exhaustive", 3, "global", "", 1.0)
    report = poses_report(
        images, ["a", "b", "c"], mapping, placed, 0.0, has_parallax=True, is_given=False
    )
    assert (report.focal_prior_px, report.focal_px) == (prior_px, 210)
    assert report.lens_settings == 3
