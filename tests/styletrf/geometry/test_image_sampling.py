import numpy as np
import pytest

from styletrf.geometry.image_sampling import sample_at

Y, X = np.indices((30, 40), dtype=np.float32)
RAMP = np.stack([X, Y, X - 2 * Y], axis=-1)  # linear, so exact between pixels


@pytest.mark.parametrize("shape", [(0,), (1,), (100_000,), (20, 30)])
def test_a_linear_image_is_sampled_exactly_at_points_of_any_number_and_shape(shape):
    points = np.random.default_rng(0).uniform(0, (39, 29), (*shape, 2))
    x, y = points[..., 0], points[..., 1]
    expected = np.stack([x, y, x - 2 * y], axis=-1)
    np.testing.assert_allclose(sample_at(RAMP, points), expected, atol=0.1)  # OpenCV's 1/32 px
    assert np.array_equal(sample_at(RAMP[..., 0], points), sample_at(RAMP, points)[..., 0])


def test_the_center_of_a_pixel_has_its_value_and_beyond_the_border_that_of_the_border():
    points = np.float32([[3, 5], [-7, 5], [90, 5], [3, -1], [3, 31]])
    expected = RAMP[[5, 5, 5, 0, 29], [3, 0, 39, 3, 3]]
    np.testing.assert_array_equal(sample_at(RAMP, points), expected)
