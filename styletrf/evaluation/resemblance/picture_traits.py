"""The traits by which a picture is compared with a painting or with the scene.

Colors, patches and texture (`sliced_wasserstein`), Gram matrices of EfficientNet-Lite0, and
statistics of VGG16's relu2_2 compare a picture with a painting; directions of relu4_3 compare it
with the scene.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from styletrf.errors import InputError
from styletrf.evaluation.resemblance.efficientnet_lite import EfficientNetLite0
from styletrf.evaluation.resemblance.frechet_distance import (
    FeatureStatistics,
    feature_statistics,
    frechet_distance,
)
from styletrf.evaluation.resemblance.sliced_wasserstein import (
    Picture,
    PictureProjections,
    SlicedWassersteinConfig,
    color_distance,
    patch_distance,
    picture_projections,
    texture_distance,
)
from styletrf.evaluation.sharpness import sharpness
from styletrf.style.perceptual.perceptual_loss import gram_matrix, shrunk
from styletrf.style.perceptual.vgg import REDUCTION, VGG16

_TEXTURE_LAYER, _CONTENT_LAYER = "relu2_2", "relu4_3"
_LEAST_SIDE_PX = 32


@dataclass(frozen=True, slots=True)
class TraitsConfig:
    """The sizes at which pictures are compared.

    Attributes:
        long_side_px: To this the longer side of frames is reduced.
        vgg_px: To this it is reduced for VGG16, and the painting by the same factor.
        sliced_wasserstein: Settings of the samples of pixels and patches.
    """

    long_side_px: int = 504
    vgg_px: int = 252
    sliced_wasserstein: SlicedWassersteinConfig = field(default_factory=SlicedWassersteinConfig)

    def __post_init__(self) -> None:
        if min(self.long_side_px, self.vgg_px) < REDUCTION:
            raise ValueError(f"long_side_px and vgg_px are at least {REDUCTION}")


@dataclass(frozen=True, slots=True)
class PictureTraits:
    """The traits of a picture that are compared.

    Attributes:
        projections: Those of its colors, patches and texture.
        grams: Gram matrices of EfficientNet-Lite0, stride by stride.
        texture: Statistics of relu2_2 of VGG16.
        content: relu4_3 of VGG16, each place of length 1.
        sharpness: See `styletrf.evaluation.sharpness`.
    """

    projections: PictureProjections
    grams: Sequence[Float[Tensor, "1 _ _"]]
    texture: FeatureStatistics
    content: Float[Tensor, "512 places"]
    sharpness: float


class TraitMeter:
    """Computes the traits of pictures by both networks."""

    def __init__(self, vgg: VGG16, efficientnet: EfficientNetLite0, config: TraitsConfig) -> None:
        """Takes the two networks, which lie on one device."""
        self._vgg, self._efficientnet, self._config = vgg, efficientnet, config

    def of_frame(self, frame: Picture, sharpness_px: int | None = None) -> PictureTraits:
        """Returns the traits of a frame, reduced to `long_side_px`.

        Args:
            frame: RGB in [0, 1].
            sharpness_px: The longer side at which its sharpness is measured, if that is shorter.

        Raises:
            InputError: The frame is smaller than 8x8 pixels.
        """
        size = self._size(frame)
        seen = _resized(frame, *size)
        long_px = self._config.long_side_px
        sharp_size = _reduced_size(frame, min(sharpness_px or long_px, long_px))
        judged = seen if sharp_size == size else _resized(frame, *sharp_size)
        return self._traits(seen, sharpness(judged), max(size))

    def of_painting(self, painting: Picture, frame: Picture) -> PictureTraits:
        """Returns the traits of a painting at the size at which it compares with a frame.

        It is made smaller or larger, its proportions kept, until it has as many pixels as the
        reduced frame; no side becomes shorter than 32 pixels or the frame's shorter side, so that a
        painting 500 times as long as wide is looked at compressed. VGG16 sees it at the same scale
        as the frame.
        """
        height, width = self._size(frame)
        scale = np.sqrt(height * width / (painting.shape[0] * painting.shape[1]))
        least = min(_LEAST_SIDE_PX, height, width)
        down, across = (max(least, round(side * scale)) for side in painting.shape[:2])
        seen = _resized(painting, down, across)
        return self._traits(seen, sharpness(seen), max(height, width))

    def _size(self, frame: Picture) -> tuple[int, int]:
        if min(frame.shape[:2]) < REDUCTION:
            raise InputError(
                f"frame of {frame.shape[1]}x{frame.shape[0]} pixels",
                f"is smaller than the {REDUCTION} pixels that measures of style look at",
                "Render larger frames",
            )
        return _reduced_size(frame, self._config.long_side_px)

    @torch.inference_mode()
    def _traits(self, image: Picture, sharp: float, frame_px: int) -> PictureTraits:
        """Returns the traits of an image beside a frame whose longer side is `frame_px`."""
        tensor = torch.from_numpy(image).to(self._vgg.mean.device)
        short_px = self._config.vgg_px * min(image.shape[:2]) // frame_px
        small = shrunk(tensor, max(REDUCTION, short_px))
        fast = small.contiguous(memory_format=torch.channels_last)
        seen = self._vgg.features(fast, [_TEXTURE_LAYER, _CONTENT_LAYER])
        layers = self._efficientnet.features(tensor.permute(2, 0, 1)[None])
        return PictureTraits(
            projections=picture_projections(image, self._config.sliced_wasserstein),
            grams=[gram_matrix(features) for features in layers],
            texture=feature_statistics(seen[_TEXTURE_LAYER][0].flatten(1)),
            content=functional.normalize(seen[_CONTENT_LAYER][0].flatten(1).float(), dim=0),
            sharpness=sharp,
        )


@torch.inference_mode()
def gram_distance(a: PictureTraits, b: PictureTraits) -> float:
    """Returns the mean over layers of |G_a - G_b| / (|G_a| + |G_b|), Frobenius norms, in [0, 1].

    `G` are Gram matrices of EfficientNet-Lite0 (Gatys et al. 2016, equation 3, over the number of
    elements) at strides 2, 4, 8 and 16. Layers that are 0 in both differ by 0.
    """
    ratios = []
    for x, y in zip(a.grams, b.grams, strict=True):
        total = x.norm() + y.norm()
        ratios.append((x - y).norm() / total.clamp(min=torch.finfo(total.dtype).tiny))
    return float(torch.stack(ratios).mean())


@torch.inference_mode()
def content_distance(a: PictureTraits, b: PictureTraits) -> float:
    """Returns 1 minus the mean cosine of relu4_3 over the places of two pictures of one size.

    The distance lies in [0, 1], and is 0 for equal pictures. A place without any activation has a
    cosine of 0 with all others.
    """
    return float(1 - (a.content * b.content).sum(dim=0).mean())


@torch.inference_mode()
def unrelated_content_distance(a: PictureTraits, b: PictureTraits) -> float:
    """Returns 1 minus the mean cosine of relu4_3 over all pairs of a place of `a` and one of `b`.

    `content_distance` has this value where places of one picture have nothing to do with those of
    the other, as those of a frame and of a painting. Their sizes may differ.
    """
    return float(1 - (a.content.mean(dim=1) * b.content.mean(dim=1)).sum())


def distances(picture: PictureTraits, painting: PictureTraits) -> dict[str, float]:
    """Returns how far a picture is from a painting by every measure; 0 for the painting itself."""
    return {
        "style_swd_colors": color_distance(picture.projections, painting.projections),
        "style_swd_patches": patch_distance(picture.projections, painting.projections),
        "style_swd_texture": texture_distance(picture.projections, painting.projections),
        "style_gram": gram_distance(picture, painting),
        "sifid_vgg": frechet_distance(picture.texture, painting.texture),
    }


def nearest_painting(
    picture: PictureTraits, paintings: Mapping[str, PictureTraits]
) -> dict[str, str]:
    """Returns by each measure the name of the painting that a picture is nearest to."""
    found = {name: distances(picture, painting) for name, painting in paintings.items()}
    measures = next(iter(found.values()), {})
    return {measure: min(found, key=lambda name: found[name][measure]) for measure in measures}


def reduced(picture: Picture, long_side_px: int) -> Picture:
    """Returns a picture within [0, 1] whose longer side is at most this, as frames are reduced."""
    return _resized(picture, *_reduced_size(picture, long_side_px))


def _reduced_size(picture: Picture, long_side_px: int) -> tuple[int, int]:
    scale = min(1.0, long_side_px / max(picture.shape[:2]))
    height, width = (max(REDUCTION, round(side * scale)) for side in picture.shape[:2])
    return height, width


def _resized(image: Picture, height: int, width: int) -> Picture:
    clipped = np.ascontiguousarray(np.clip(image, 0, 1), dtype=np.float32)
    if (height, width) == image.shape[:2]:
        return clipped
    is_smaller = height * width < image.shape[0] * image.shape[1]
    how = cv2.INTER_AREA if is_smaller else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(clipped, (width, height), interpolation=how))
