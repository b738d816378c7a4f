"""Estimates the optical flow between two frames, and warps one of them to the other."""

from collections.abc import Callable
from typing import Final, Literal, final, get_args

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float

from styletrf.errors import InputError
from styletrf.evaluation.raft_flow import raft_estimator
from styletrf.geometry.image_sampling import sample_at

_SMALLEST_SIDE = 16  # below, DIS has no room for its patches, and crashes on wide frames

Image = Float[np.ndarray, "height width 3"]
Flow = Float[np.ndarray, "height width 2"]
Mask = Bool[np.ndarray, "height width"]

Method = Literal["dis", "farneback", "deepflow", "raft"]
METHODS: tuple[Method, ...] = get_args(Method)

Interpolation = Literal["linear", "cubic"]
_INTERPOLATIONS = {"linear": cv2.INTER_LINEAR, "cubic": cv2.INTER_CUBIC}


@final
class FlowEstimator:
    """Estimates the optical flow between frames by one method; made once, for many frames."""

    def __init__(self, method: Method = "dis", device: torch.device | str = "cpu") -> None:
        """Prepares the estimator.

        Args:
            method: `dis` (Kroeger et al. 2016, medium preset), `farneback` (Farneback 2003) or
                `deepflow` (Weinzaepfel et al. 2013, without its matching), on 8 bit luminance;
                or `raft` (Teed and Deng 2020), see `styletrf.evaluation.raft_flow`.
            device: Where `raft` computes; the others compute on the CPU.

        Raises:
            InputError: A package or the weights of the method are missing.
        """
        self.method: Final = method
        self._estimate = raft_estimator(device) if method == "raft" else _of_luminance(method)

    def __call__(self, a: Image, b: Image) -> Flow:
        """Returns the displacement (x, y) in pixels from each pixel of `a` to its place in `b`.

        Args:
            a: The frame that the flow is defined on, in [0, 1].
            b: The frame that it leads to.

        Raises:
            InputError: The frames are smaller than 16 pixels.
        """
        if min(a.shape[:2]) < _SMALLEST_SIDE:
            raise InputError(
                f"frame of {a.shape[1]}x{a.shape[0]} pixels",
                "is too small for optical flow",
                f"Use frames of at least {_SMALLEST_SIDE} pixels",
            )
        return self._estimate(a, b)


def _of_luminance(method: str) -> Callable[[Image, Image], Flow]:
    makers: dict[str, Callable[[], cv2.DenseOpticalFlow]] = {
        "dis": lambda: cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM),
        "farneback": cv2.FarnebackOpticalFlow.create,
        "deepflow": cv2.optflow.createOptFlow_DeepFlow,
    }
    flow = makers[method]()

    def estimate(a: Image, b: Image) -> Flow:
        start = np.zeros((*a.shape[:2], 2), dtype=np.float32)
        return np.asarray(flow.calc(_luminance(a), _luminance(b), start))

    return estimate


def warp_to_a(
    b_image: Float[np.ndarray, "height width channels"],
    flow_a_to_b: Flow,
    interpolation: Interpolation = "linear",
) -> tuple[Float[np.ndarray, "height width channels"], Mask]:
    """Returns `b_image` seen from frame a, and where that lies inside `b_image`.

    Backward warp: the value at pixel p is `b_image(p + flow(p))`. Far outside the image it is that
    of the nearest border pixel, which is repeated there; the mask is false outside.

    Args:
        b_image: The frame that is brought back.
        flow_a_to_b: From each pixel of a to its place in b, in pixels.
        interpolation: Between pixels, in both directions: `linear`, or `cubic` (Keys 1981, with
            OpenCV's -0.75), which keeps 97 % and not 71 % of stripes of four pixels half a pixel
            further, and goes beyond the range of the image at edges.
    """
    height, width = b_image.shape[:2]
    rows, columns = np.indices((height, width), dtype=np.float32)
    # beyond the border all is alike; OpenCV's integers overflow on places far beyond it
    x = np.clip(columns + flow_a_to_b[..., 0], -1, width)
    y = np.clip(rows + flow_a_to_b[..., 1], -1, height)
    inside = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
    points = np.stack([x, y], axis=-1)
    return sample_at(b_image, points, _INTERPOLATIONS[interpolation]), inside


def agreement(flow_a_to_b: Flow, flow_b_to_a: Flow) -> Mask:
    """Returns the pixels of a that come back to themselves by way of b.

    A pixel p is kept where its way there, w = flow_a_to_b(p), and back, v = flow_b_to_a(p + w),
    cancel: |w + v|^2 < 0.01 (|w|^2 + |v|^2) + 0.5 (Sundaram et al. 2010, equation 5), and p + w is
    inside the image. Pixels that moved behind something else fail this.
    """
    back, inside = warp_to_a(flow_b_to_a, flow_a_to_b)
    residual = np.square(flow_a_to_b + back).sum(axis=-1)
    length = np.square(flow_a_to_b).sum(axis=-1) + np.square(back).sum(axis=-1)
    valid: Mask = inside & (residual < 0.01 * length + 0.5)
    return valid


def _luminance(image: Image) -> np.ndarray:
    levels = np.rint(np.clip(image, 0.0, 1.0) * 255).astype(np.uint8)
    return np.asarray(cv2.cvtColor(levels, cv2.COLOR_RGB2GRAY))
