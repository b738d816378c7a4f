"""The size at which views are painted."""

import pytest
import torch

from styletrf.stylization.painters import painting_at


def stripes(image):
    """Paints black and white columns, each a pixel wide, whatever the view shows."""
    columns = (torch.arange(image.shape[1]) % 2).float()
    return columns[None, :, None].expand(image.shape)


def test_strokes_of_a_view_twice_as_large_are_twice_as_wide():
    view = torch.rand((24, 32, 3), generator=torch.Generator().manual_seed(0))
    shown = painting_at(stripes, 16)(view)
    assert shown.shape == view.shape
    dark = (shown[0, 4:-4, 0] < 0.5).int().tolist()
    assert dark == [1, 1, 0, 0] * 6


def test_a_flat_view_keeps_its_color():
    view = torch.full((30, 40, 3), 0.3)
    assert torch.allclose(painting_at(lambda image: image, 17)(view), view, atol=1e-6)


@pytest.mark.parametrize("size", [0, 32, 500])
def test_a_view_that_is_no_larger_is_painted_as_it_is(size):
    view = torch.rand((24, 32, 3), generator=torch.Generator().manual_seed(0))
    assert torch.equal(painting_at(stripes, size)(view), stripes(view))
    assert torch.equal(painting_at(lambda image: image, size)(view), view)


def test_colors_of_an_enlarged_picture_stay_within_their_range():
    view = torch.rand((40, 40, 3), generator=torch.Generator().manual_seed(0)).round()
    shown = painting_at(lambda image: image.round(), 20)(view)
    assert float(shown.min()) >= 0
    assert float(shown.max()) <= 1
