"""SIFT features of a photograph (Lowe 2004), found and described by OpenCV.

OpenCV takes a quarter of the time of COLMAP's own SIFT for poses that agree as well with those
that came with scenes: docs/decisions/0037-features-and-matches.md.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8

Descriptors = UInt8[np.ndarray, "_ 128"]
Gray = UInt8[np.ndarray, "height width"]

DESCRIPTOR_LENGTH = 512.0
"""The length of a descriptor, but for rounding."""
_CONTRAST = 0.0134  # two thirds of COLMAP's threshold: about as many features are found


@dataclass(frozen=True, slots=True)
class Features:
    """Features of one photograph, the largest first.

    Attributes:
        keypoints: x_px and y_px (the top left corner of the photograph is 0, 0), scale_px and
            angle_rad.
        descriptors: RootSIFT (Arandjelović and Zisserman 2012), times 512.
    """

    keypoints: Float32[np.ndarray, "features 4"]
    descriptors: Descriptors


def sift_features(gray: Gray, max_features: int, mask: Gray | None = None) -> Features:
    """Returns the largest features of a photograph, which begin at half a pixel's size.

    Args:
        gray: The photograph in gray, in [0, 255].
        max_features: How many to return at most.
        mask: Features are sought where it is not 0; None for everywhere.
    """
    detector = cv2.SIFT.create(contrastThreshold=_CONTRAST, enable_precise_upscale=True)
    found, described = detector.detectAndCompute(gray, mask)
    if not found:
        return Features(np.empty((0, 4), np.float32), np.empty((0, 128), np.uint8))
    keypoints = np.array(
        [(one.pt[0] + 0.5, one.pt[1] + 0.5, one.size / 2, np.radians(one.angle)) for one in found],
        np.float32,
    )
    largest = np.lexsort((*keypoints.T, -keypoints[:, 2]))[:max_features]
    return Features(keypoints[largest], _root_sift(described[largest]))


def _root_sift(descriptors: Float[np.ndarray, "features 128"]) -> Descriptors:
    fractions = descriptors / np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-9)
    rooted: Descriptors = (
        np.rint(DESCRIPTOR_LENGTH * np.sqrt(fractions)).clip(0, 255).astype(np.uint8)
    )
    return rooted
