"""Models whose photographs share a lens, rightly or wrongly, of points and cameras made up."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from styletrf.sfm.colmap_images import ColmapImages
from styletrf.sfm.lens_settings import LensSetting
from styletrf.sfm.own_lenses import give_own_lenses, shared_lenses_differ, with_own_lenses

COUNT = 10


def adjusted(zooms, seed=0):
    """Returns a model, adjusted with one lens, of photographs that were taken at the zooms."""
    pycolmap.set_random_seed(seed)
    options = pycolmap.SyntheticDatasetOptions(
        num_rigs=1, num_cameras_per_rig=1, num_frames_per_rig=len(zooms), num_points3D=400
    )
    model = pycolmap.synthesize_dataset(options)
    rng = np.random.default_rng(seed)
    for number, zoom in zip(sorted(model.reg_image_ids()), zooms, strict=True):
        image = model.image(number)
        middle = np.array([image.camera.principal_point_x, image.camera.principal_point_y])
        for point in image.points2D:
            point.xy = middle + zoom * (point.xy - middle) + rng.normal(0, 0.7, 2)
    pycolmap.bundle_adjustment(model)
    return model


def names_of(model):
    return tuple(model.image(number).name for number in sorted(model.reg_image_ids()))


def images_of(files, assumed, focal_px=None):
    setting = LensSetting(tuple(files), focal_px, None, tuple(assumed))
    return ColmapImages(Path(), tuple(files), 1024, (setting,))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("zoom", "differ"), [(1.0, False), (1.05, True), (1.3, True)])
def test_photographs_at_two_zooms_contradict_the_lens_that_they_share(zoom, differ, seed):
    model = adjusted([1.0, zoom] * (COUNT // 2), seed)
    files = names_of(model)
    assert shared_lenses_differ(model, images_of(files, files)) is differ


def test_a_lens_that_is_known_is_not_contradicted():
    model = adjusted([1.0, 1.3] * (COUNT // 2))
    assert not shared_lenses_differ(model, images_of(names_of(model), ()))


def test_most_photographs_may_lack_exif_and_contradict_the_lens_of_the_few_that_have_it():
    model = adjusted([1.0] * 4 + [1.2] * 6)
    files = names_of(model)
    assert shared_lenses_differ(model, images_of(files, files[4:], 1.0))


def test_a_plane_seen_head_on_contradicts_no_lens():
    model = adjusted([1.0] * COUNT)
    for number in model.reg_image_ids():
        image = model.image(number)
        pose = image.cam_from_world().matrix()
        for point in image.get_observation_points2D():
            x, y, _ = pose[:, :3] @ model.point3D(point.point3D_id).xyz + pose[:, 3]
            model.point3D(point.point3D_id).xyz = pose[:, :3].T @ ([x, y, 5.0] - pose[:, 3])
        with np.errstate(all="ignore"):
            assert not shared_lenses_differ(model, images_of((image.name,), (image.name,)))


@pytest.mark.parametrize(("assumed", "differ"), [(slice(7, 10), True), (slice(0, 3), False)])
def test_photographs_without_exif_contradict_the_lens_of_those_with_it_where_it_is_not_theirs(
    assumed, differ
):
    model = adjusted([1.0] * 7 + [1.2] * 3)
    files = names_of(model)
    assert shared_lenses_differ(model, images_of(files, files[assumed], 700.0)) is differ


def test_photographs_that_see_next_to_nothing_say_nothing_of_their_lens():
    model = adjusted([1.0, 1.3] * (COUNT // 2))
    for number in list(model.point3D_ids())[20:]:
        model.delete_point3D(number)
    files = names_of(model)
    assert not shared_lenses_differ(model, images_of(files, files))


def test_only_photographs_of_which_a_lens_is_assumed_get_their_own():
    images = with_own_lenses(images_of("abcd", "bd", 700.0))
    assert images.lenses == (
        LensSetting(("a", "c"), 700.0),
        LensSetting(("b",), None),
        LensSetting(("d",), None),
    )


def test_nothing_is_known_of_an_own_lens_but_of_the_one_that_others_keep(tmp_path):
    database = tmp_path / "colmap.db"
    params = [700.0, 320.0, 240.0, 0.0]
    lens = pycolmap.Camera(model="SIMPLE_RADIAL", width=640, height=480, params=params)
    lens.has_prior_focal_length = True
    with closing(pycolmap.Database.open(database)) as opened:
        number = opened.write_camera(lens)
        for name in "abc":
            opened.write_image(pycolmap.Image(name=name, camera_id=number))
    give_own_lenses(database, with_own_lenses(images_of("abc", "c", 700.0)))
    with closing(pycolmap.Database.open(database)) as opened:
        cameras = [opened.read_camera(image.camera_id) for image in opened.read_all_images()]
    assert [camera.has_prior_focal_length for camera in cameras] == [True, True, False]
    assert [camera.params[0] for camera in cameras] == [700.0] * 3
    assert len({camera.camera_id for camera in cameras}) == 2
