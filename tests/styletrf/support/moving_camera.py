"""A camera that moves along a painted wall: frames whose every correspondence is known."""

import cv2
import numpy as np

from styletrf.evaluation.consistency.frame_pairs import Frame
from styletrf.files.float_images import FloatImage
from styletrf.geometry.cameras import Camera

FRAMES, HEIGHT, WIDTH = 8, 72, 96
STEP = 2  # pixels a frame
FOCAL_PX, DEPTH = 100.0, 10.0


def texture(seed, width=WIDTH + STEP * FRAMES):
    noise = np.random.default_rng(seed).random((HEIGHT, width, 3)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 2)
    return (smooth - smooth.min()) / (smooth.max() - smooth.min())


def pan(painting, frames=FRAMES):
    """What is seen of a painting of the wall."""
    return [painting[:, STEP * i : STEP * i + WIDTH] for i in range(frames)]


def camera(k):
    """The camera of frame k."""
    pose = np.column_stack([np.eye(3), [k * STEP * DEPTH / FOCAL_PX, 0.0, 0.0]])
    return Camera(f"{k}", WIDTH, HEIGHT, FOCAL_PX, FOCAL_PX, WIDTH / 2, HEIGHT / 2, pose)


def shown(plain, painted, cameras=None, own_depth=None):
    """The frames of a trajectory, one by one; `own_depth` is that of the stylized field."""
    cameras = cameras or [camera(k) for k in range(len(plain))]
    for k, (image, style) in enumerate(zip(plain, painted, strict=True)):
        whole = np.ones(image.shape[:2], np.float32)
        own = None if own_depth is None else own_depth * whole
        yield Frame(cameras[k], FloatImage(image, whole, DEPTH * whole), style, own)
