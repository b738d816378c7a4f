"""Measures the held-out views once more, with their cameras aligned to the field.

Cameras are a little off, and the field was never fitted to those held out. Their errors lower the
PSNR of sharp detail although the field may show it rightly; aligned cameras show by how much. They
serve measuring alone: no fit and no choice sees one.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from styletrf.capture.view_images import Image as ViewImage
from styletrf.evaluation.alignment.image_alignment import Render, aligned
from styletrf.evaluation.metrics import mean_squared_error
from styletrf.evaluation.quality import counted_pixels
from styletrf.files.images import from_integers
from styletrf.geometry.cameras import Camera
from styletrf.psnr import psnr_of_error

LONG_SIDES_PX = (96, 192, 384)


def aligned_psnr(
    cameras: Sequence[Camera],
    psnr: Sequence[float],
    photographs: Iterable[ViewImage],
    render: Render,
) -> list[float]:
    """Returns the PSNR of each view, in dB, where its render agrees best with the photograph.

    A camera that alignment makes worse stays where it was.

    Args:
        cameras: The cameras of the views, in the world of the renders.
        psnr: The PSNR of the views with these cameras.
        photographs: At the cameras' sizes; pixels of alpha 0 do not count.
        render: Renders the field from a camera.
    """
    found = []
    for camera, given, photograph in zip(cameras, psnr, photographs, strict=True):
        reference = from_integers(np.ascontiguousarray(photograph[..., :3].numpy()))
        counts = counted_pixels(photograph)
        sides = [side for side in LONG_SIDES_PX if side < max(camera.width, camera.height)]
        moved = aligned(camera, reference, render, sides or LONG_SIDES_PX[:1], counts).camera
        error = mean_squared_error(render(moved).color.numpy(), reference, counts)
        found.append(max(given, psnr_of_error(error)))
    return found
