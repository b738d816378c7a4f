"""Pixels by number: the view, row and column they are, and what they show."""

import pytest
import torch
from mini_scene import SIZE, painted_plane

from styletrf.capture.view_images import view_images
from styletrf.field.pixel_rays import pixel_rays
from styletrf.field.view_rays import ViewRays
from styletrf.geometry.cameras import pixel_centers


def test_pixels_are_counted_row_by_row_and_view_after_view():
    scene = painted_plane()
    rays = ViewRays(scene.cameras, scene.model.space, 0.1, torch.device("cpu"))
    of_view_2 = 2 * SIZE * SIZE + torch.arange(SIZE * SIZE)
    segments, colors = pixel_rays(rays, view_images(scene.images), of_view_2)
    torch.testing.assert_close(colors.reshape(SIZE, SIZE, 3), scene.images[2].float() / 255)
    centers = torch.as_tensor(pixel_centers(SIZE, SIZE))
    expected = rays.segments(torch.full((SIZE * SIZE,), 2), centers)
    torch.testing.assert_close(segments.origins, expected.origins)
    torch.testing.assert_close(segments.directions, expected.directions)


def test_views_of_different_sizes_are_counted_one_after_another():
    scene = painted_plane()
    sizes = [(3, 5), (5, 3), (1, 1)]
    images = [torch.randint(256, (*size, 3), dtype=torch.uint8) for size in sizes]
    packed = view_images(images)
    for k, image in enumerate(images):
        numbers = packed.of_view(k)
        view, centers = packed.places(numbers)
        assert (view == k).all()
        expected = torch.as_tensor(pixel_centers(image.shape[1], image.shape[0]))
        torch.testing.assert_close(centers, expected)
        torch.testing.assert_close(packed.pixels[numbers], image.reshape(-1, 3))
    assert len(packed) == sum(len(packed.of_view(k)) for k in range(len(images)))
    assert len(scene.images) == len(view_images(scene.images).ends)


def test_pixels_that_a_mask_leaves_out_are_never_drawn():
    plain = torch.full((4, 6, 3), 200, dtype=torch.uint8)
    masked = torch.randint(256, (5, 5, 4), dtype=torch.uint8)
    masked[..., 3] = 255 * (torch.arange(25) % 3 == 0).reshape(5, 5)
    packed = view_images([plain, masked])
    drawn = packed.drawn(2000, torch.Generator().manual_seed(0))
    counted = (torch.arange(25) % 3 == 0).nonzero()[:, 0] + 24
    assert set(drawn.tolist()) == {*range(24), *counted.tolist()}
    torch.testing.assert_close(packed.pixels[24:], masked[..., :3].reshape(-1, 3))


def test_images_of_which_nothing_counts_are_refused():
    with pytest.raises(ValueError, match="no pixel"):
        view_images([torch.zeros((4, 6, 4), dtype=torch.uint8)])
