import numpy as np
import pycolmap
import pytest
from mapped_walks import frames, mapped, street, walked

from styletrf.sfm.mapping import SfmResult, explained_fraction
from styletrf.sfm.model_joining import joined

COUNT, SHARED = 12, 4


@pytest.fixture(params=[(150.0,), (150.0, 110.0, 190.0, 130.0)], ids=["one lens", "four lenses"])
def halves(tmp_path, request):
    """A street's model, and its two ends as models of their own frames that share photographs."""
    database, images = walked(tmp_path, street(COUNT), request.param)
    whole = mapped(database, images, frames(COUNT), 90).models[0]
    ids = sorted(whole.reg_image_ids())
    assert len(ids) == COUNT
    first, second = pycolmap.Reconstruction(whole), pycolmap.Reconstruction(whole)
    for k, image_id in enumerate(ids):
        model = first if k >= (COUNT + SHARED) // 2 + 1 else second
        if not (COUNT - SHARED) // 2 <= k < (COUNT + SHARED) // 2 + 1:
            model.deregister_frame(model.image(image_id).frame_id)
    for model in (first, second):
        model.tear_down()  # what no image of a model uses is not in it, as after a mapping
    turn = pycolmap.Rotation3d(np.array([0.3, -0.2, 0.5]))
    second.transform(pycolmap.Sim3d(2.5, turn, np.array([1.0, -4.0, 2.0])))
    return database, whole, [first, second]


def centers(model):
    return np.stack([model.image(i).projection_center() for i in sorted(model.reg_image_ids())])


def distances(model):
    """Between all pairs of cameras, by the largest: what a similarity leaves alone."""
    places = centers(model)
    between = np.linalg.norm(places[:, None] - places, axis=-1)
    return between / between.max()


def mapping_of(database, models):
    explained = explained_fraction(database, models)
    return SfmResult(models, "exhaustive", 1, "incremental", "", explained)


def test_two_halves_that_share_photographs_become_the_whole(halves):
    database, whole, models = halves
    found = joined(database, mapping_of(database, models), 3, 0)
    assert (found.registered, len(found.models)) == (COUNT, 1)
    assert found.mapper == "incremental, 2 models joined"
    np.testing.assert_allclose(distances(found.models[0]), distances(whole), atol=2e-3)
    assert found.explained > 0.9


def test_models_that_share_no_photograph_stay_apart(halves):
    database, _, (first, second) = halves
    for image_id in first.reg_image_ids():
        if image_id in set(second.reg_image_ids()):
            second.deregister_frame(second.image(image_id).frame_id)
    mapping = mapping_of(database, [first, second])
    assert joined(database, mapping, 3, 0) is mapping


def test_one_model_stays_as_it_is(halves):
    database, whole, _ = halves
    mapping = mapping_of(database, [whole])
    assert joined(database, mapping, 3, 0) is mapping


def test_joining_gives_the_same_model_twice(halves):
    database, _, models = halves
    wholes = [joined(database, mapping_of(database, models), 3, 0).models[0] for _ in range(2)]
    np.testing.assert_array_equal(centers(wholes[0]), centers(wholes[1]))
