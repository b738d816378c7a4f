"""Pixels by number: the view, row and column they are, and what they show."""

import torch
from mini_scene import SIZE, painted_plane

from styletrf.cameras import pixel_centers
from styletrf.pixel_rays import pixel_rays
from styletrf.space import ViewRays


def test_pixels_are_counted_row_by_row_and_view_after_view():
    scene = painted_plane()
    rays = ViewRays(scene.cameras, scene.model.space, 0.1, torch.device("cpu"))
    of_view_2 = 2 * SIZE * SIZE + torch.arange(SIZE * SIZE)
    segments, colors = pixel_rays(rays, scene.images, of_view_2)
    torch.testing.assert_close(colors.reshape(SIZE, SIZE, 3), scene.images[2].float() / 255)
    centers = torch.as_tensor(pixel_centers(SIZE, SIZE))
    expected = rays.segments(torch.full((SIZE * SIZE,), 2), centers)
    torch.testing.assert_close(segments.origins, expected.origins)
    torch.testing.assert_close(segments.directions, expected.directions)
