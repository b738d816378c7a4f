"""Float frames: what their files say of a render."""

import numpy as np
import torch

from styletrf.field.rendering import Rendering
from styletrf.files.float_images import read_float_image
from styletrf.geometry.cameras import Camera
from styletrf.trajectory.frames import write_float_frames


def test_a_float_frame_has_the_depth_at_which_half_the_light_is_lost(tmp_path):
    """Not that of the mean position, which lies between two surfaces that share a pixel.

    Where less than half is lost, it has the mean; only where nothing is hit, it is infinite.
    """
    camera = Camera("0000", 3, 1, 2.0, 2.0, 1.5, 0.5, np.eye(4)[:3])
    mean = torch.tensor([[4.0, 5.0, torch.inf]])
    median = torch.tensor([[2.0, torch.inf, torch.inf]])
    render = Rendering(torch.rand(1, 3, 3), torch.tensor([[1.0, 0.3, 0.0]]), mean, median)
    write_float_frames(tmp_path, [camera], iter([render]))
    frame = read_float_image(tmp_path / "frames" / "0000.exr")
    assert frame.depth.tolist() == [[2.0, 5.0, np.inf]]
