import numpy as np
import pytest
import torch

from styletrf.geometry.image_sampling import sample_at
from styletrf.geometry.tensor_sampling import sample_tensor_at

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


def test_an_image_of_bytes_is_sampled_in_bytes():
    sampled = sample_at(RAMP[..., :2].astype(np.uint8), np.float32([[3, 5], [2.5, 7.5]]))
    assert sampled.dtype == np.uint8
    np.testing.assert_allclose(sampled, [[3, 5], [2.5, 7.5]], atol=0.5)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_linear_tensor_is_sampled_exactly_and_differentiably(dtype):
    points = torch.rand(1, 20, 30, 2, dtype=dtype) * torch.tensor([39, 29], dtype=dtype)
    ramp = torch.from_numpy(RAMP).to(dtype).permute(2, 0, 1)[None].contiguous().requires_grad_()
    sampled = sample_tensor_at(ramp, points, "border")
    x, y = points.unbind(dim=-1)
    torch.testing.assert_close(sampled, torch.stack([x, y, x - 2 * y], dim=1), atol=1e-4, rtol=0)
    sampled.sum().backward()
    weights = torch.full((3,), 20.0 * 30, dtype=dtype)
    torch.testing.assert_close(ramp.grad.sum(dim=(0, 2, 3)), weights, atol=1e-2, rtol=0)


def test_far_beyond_its_border_a_tensor_has_the_values_of_the_border_or_zeros():
    points = np.float32([[[-7, 5], [90, 5], [3, -2], [3, 31]]])
    ramp = torch.from_numpy(RAMP).permute(2, 0, 1)[None].contiguous()
    border, zeros = (
        sample_tensor_at(ramp, torch.from_numpy(points)[None], beyond)[0].permute(1, 2, 0)
        for beyond in ("border", "zeros")
    )
    np.testing.assert_allclose(border, sample_at(RAMP, points), atol=1e-4)
    assert not zeros.any()
