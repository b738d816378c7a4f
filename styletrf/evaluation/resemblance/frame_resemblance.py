"""Measures on a few stylized frames whether they resemble the painting and show the scene.

Nothing is trained with these measures. Each distance to the painting stands beside the same
distance of the unstylized frames; their ratio is 1 for "not stylized" and 0 for "the painting".
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from styletrf.evaluation.resemblance.picture_traits import (
    PictureTraits,
    TraitMeter,
    TraitsConfig,
    content_distance,
    distances,
    reduced,
    unrelated_content_distance,
)
from styletrf.evaluation.resemblance.sliced_wasserstein import Picture
from styletrf.evaluation.sharpness import sharpness
from styletrf.even_spread import evenly_spread
from styletrf.finiteness import require_finite
from styletrf.progress import Progress, silent

STYLE_DISTANCES = (
    "style_swd_colors", "style_swd_patches", "style_swd_texture", "style_gram", "sifid_vgg",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class ResemblanceConfig:
    """Settings of the comparison.

    Attributes:
        frames: How many are compared, spread over the trajectory.
        traits: The sizes at which they are compared.
    """

    frames: int = 6
    traits: TraitsConfig = field(default_factory=TraitsConfig)

    def __post_init__(self) -> None:
        if self.frames < 1:
            raise ValueError("frames is at least 1")


@dataclass(frozen=True, slots=True)
class FrameResemblance:
    """One frame; `X_unstylized` is `X` of the unstylized frame.

    Attributes:
        view: Its name.
        style_swd_colors: Sliced Wasserstein distance of colors to the painting.
        style_swd_patches: The same of 7x7 patches at three scales.
        style_swd_texture: The same of patches without their mean colors.
        style_gram: Relative distance of Gram matrices of EfficientNet-Lite0 to the painting.
        sifid_vgg: Squared Fréchet distance of statistics of relu2_2 to the painting.
        content_distance: The distance of relu4_3 to the unstylized frame.
        content_distance_painting: The same of the painting and the unstylized frame.
        sharpness: The sharpness of the frame, reduced to the priors' size if that is smaller.
    """

    view: str
    style_swd_colors: float
    style_swd_colors_unstylized: float
    style_swd_patches: float
    style_swd_patches_unstylized: float
    style_swd_texture: float
    style_swd_texture_unstylized: float
    style_gram: float
    style_gram_unstylized: float
    sifid_vgg: float
    sifid_vgg_unstylized: float
    content_distance: float
    content_distance_painting: float
    sharpness: float
    sharpness_unstylized: float


def measure_resemblance(
    views: Sequence[str],
    frames: Callable[[str], tuple[Picture, Picture]],
    painting: Picture,
    priors: Sequence[Picture],
    meter: TraitMeter,
    config: ResemblanceConfig,
    progress: Progress = silent,
    objects: Callable[[str], tuple[Picture, Picture]] | None = None,
) -> tuple[list[FrameResemblance], dict[str, float | None]]:
    """Returns the measures of some views, and their summary.

    Args:
        views: Names along the trajectory, of which `config.frames` are chosen evenly.
        frames: Gives the unstylized and the stylized frame of a view, of one size, in [0, 1].
        painting: The style image, in [0, 1].
        priors: The painted views that the frames were fitted to; none where there are none.
        meter: Measures their traits.
        config: Which frames are measured, and at which sizes.
        progress: Called after every frame.
        objects: Gives the same frames with the objects that are cut out on their mean colors: these
            are compared with the painting. Their content and sharpness are those of `frames`. None
            if frames have no background.

    Raises:
        InputError: A frame is smaller than 8x8 pixels.
        NotFiniteError: A frame or a measure of it is not finite.
    """
    chosen = evenly_spread(views, config.frames)
    rows: list[FrameResemblance] = []
    style: PictureTraits | None = None
    side_px = config.traits.long_side_px
    for view in chosen:
        plain, stylized = frames(view)
        require_finite("resemblance", f"in frame {view}", [("frame", plain), ("style", stylized)])
        style = style or meter.of_painting(painting, plain)
        side_px = common_side_px(plain, priors, config.traits)
        before, after = (meter.of_frame(frame, side_px) for frame in (plain, stylized))
        if objects is not None:
            pairs = zip((before, after), objects(view), strict=True)
            before, after = (_in_style_of(seen, meter.of_frame(alone)) for seen, alone in pairs)
        row = frame_resemblance(view, before, after, style)
        figures = [(name, np.array(value)) for name, value in _numbers(row).items()]
        require_finite("resemblance", f"in frame {view}", figures)
        rows.append(row)
        progress(len(rows), len(chosen), patches=row.style_swd_patches)
    return rows, summary(rows, [reduced(prior, side_px) for prior in priors])


def _in_style_of(seen: PictureTraits, alone: PictureTraits) -> PictureTraits:
    """Returns the content and sharpness of a frame as it is seen, and the style of its object."""
    return replace(alone, content=seen.content, sharpness=seen.sharpness)


def common_side_px(frame: Picture, priors: Sequence[Picture], config: TraitsConfig) -> int:
    """Returns the longer side that frames and priors can both be reduced to.

    Sharpness grows as a picture is reduced, so it is compared at one size.
    """
    sides: list[int] = [max(picture.shape[:2]) for picture in (frame, *priors)]
    return min(config.long_side_px, *sides)


def frame_resemblance(
    view: str, plain: PictureTraits, stylized: PictureTraits, painting: PictureTraits
) -> FrameResemblance:
    """Returns the measures of one frame."""
    unstylized = distances(plain, painting)
    return FrameResemblance(
        view=view,
        **distances(stylized, painting),
        **{f"{name}_unstylized": value for name, value in unstylized.items()},
        content_distance=content_distance(stylized, plain),
        content_distance_painting=unrelated_content_distance(painting, plain),
        sharpness=stylized.sharpness,
        sharpness_unstylized=plain.sharpness,
    )


def summary(rows: Sequence[FrameResemblance], priors: Sequence[Picture]) -> dict[str, float | None]:
    """Returns the means over frames, and ratios of them; a ratio to nothing is None.

    The priors are reduced to the size at which the sharpness of frames was measured.
    `X_ratio` is X over `X_unstylized`; `content` the content distance over the painting's;
    `sharpness_to_priors` and `sharpness_to_unstylized` name their denominators. The last number is
    that of `content_style_product`.
    """
    means = {name: float(np.mean([asdict(r)[name] for r in rows])) for name in _numbers(rows[0])}
    ratios = {f"{n}_ratio": _over(means[n], means[f"{n}_unstylized"]) for n in STYLE_DISTANCES}
    content = _over(means["content_distance"], means["content_distance_painting"])
    of_priors = float(np.mean([sharpness(p) for p in priors])) if len(priors) else None
    return {
        **means,
        **ratios,
        "content": content,
        "sharpness_priors": of_priors,
        "sharpness_to_priors": _over(means["sharpness"], of_priors),
        "sharpness_to_unstylized": _over(means["sharpness"], means["sharpness_unstylized"]),
        "content_style_product": content_style_product(content, ratios["sifid_vgg_ratio"]),
    }


def content_style_product(content: float | None, style: float | None) -> float | None:
    """Returns (1 + content) (1 + style), both as ratios; lower is better.

    It has the form of ArtFID (Wright and Ommer 2022, equation 3), which multiplies LPIPS and an FID
    with Inception; here they are the content ratio and the ratio of `sifid_vgg`, so that figures do
    not compare with published ones. Frames left unstylized and the painting put in their place both
    have 2; the scene in the painting's very statistics would have 1.
    """
    if content is None or style is None:
        return None
    return (1 + content) * (1 + style)


def _numbers(row: FrameResemblance) -> Mapping[str, float]:
    return {name: value for name, value in asdict(row).items() if name != "view"}


def _over(value: float, other: float | None) -> float | None:
    return None if other is None or other < math.ulp(1.0) else value / other
