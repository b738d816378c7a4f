"""Features of a photograph, and of the same one moved, masked and empty."""

import cv2
import numpy as np
from made_photographs import texture

from styletrf.sfm.matching.mutual_matches import mutual_matches
from styletrf.sfm.matching.sift_features import sift_features

SIZE, MANY = 256, 100_000


def gray(seed=0, size=SIZE):
    return cv2.cvtColor(texture(size, size, seed), cv2.COLOR_RGB2GRAY)


def test_features_of_a_moved_photograph_have_moved_with_it():
    wide = gray(size=SIZE + 40)
    one, other = sift_features(wide[:SIZE, :SIZE], MANY), sift_features(wide[16:, 40:], MANY)
    (matches,) = mutual_matches(one.descriptors, [other.descriptors])
    moved = one.keypoints[matches[:, 0], :2] - other.keypoints[matches[:, 1], :2]
    assert len(matches) > 100
    np.testing.assert_allclose(np.median(moved, axis=0), [40, 16], atol=0.01)
    assert np.mean(np.abs(moved - [40, 16]).max(axis=1) < 0.1) > 0.9


def test_a_mirrored_photograph_has_its_features_at_mirrored_places():
    """The middle of a pixel is half a pixel from its corner, on both sides."""
    image = gray()
    one, other = (
        sift_features(image, MANY),
        sift_features(np.ascontiguousarray(image[:, ::-1]), MANY),
    )
    mirrored = other.keypoints[:, :2] * [-1, 1] + [SIZE, 0]
    apart = np.linalg.norm(one.keypoints[:, None, :2] - mirrored[None], axis=-1).min(axis=1)
    assert np.median(apart) < 0.05


def test_the_largest_features_are_kept():
    found, few = sift_features(gray(), MANY), sift_features(gray(), 32)
    np.testing.assert_array_equal(few.keypoints, found.keypoints[:32])
    np.testing.assert_array_equal(few.descriptors, found.descriptors[:32])
    assert (np.diff(found.keypoints[:, 2]) <= 0).all()
    assert len(found.keypoints) > 200


def test_no_feature_is_where_the_mask_is_black():
    mask = np.zeros((SIZE, SIZE), np.uint8)
    mask[:, SIZE // 2 :] = 1
    found = sift_features(gray(), MANY, mask).keypoints
    assert len(found) > 100
    assert (found[:, 0] >= SIZE // 2 - 1).all()


def test_an_even_photograph_has_no_features():
    found = sift_features(np.full((64, 48), 127, np.uint8), MANY)
    assert found.keypoints.shape == (0, 4)
    assert found.descriptors.shape == (0, 128)


def test_descriptors_have_a_length_of_512():
    lengths = np.linalg.norm(sift_features(gray(), MANY).descriptors.astype(float), axis=1)
    np.testing.assert_allclose(lengths, 512, rtol=0.02)
