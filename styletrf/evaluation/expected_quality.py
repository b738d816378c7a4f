"""The PSNR that a fit will reach on views that it does not see, from two brief fits.

A fit of twice the iterations is better by a gain, and from one doubling to the next the gain falls
by a constant ratio r:

    psnr(2^k n) = psnr(n) + r (1 + r + ... + r^(k-1)) (psnr(n) - psnr(n/2)).

Learning curves are commonly taken to be power laws (Hestness et al. 2017), whose gains by doublings
fall so. On horns, fern and lego at `draft`, the gain of whole fits of twice the iterations was 0.40
to 0.84 of the gain of the doubling before (`benchmarks/history.md`, "Time against accuracy", before
fields had averaged parameters); r lies between. The error of predictions is still to be measured,
by `benchmarks/expected_quality.py`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.capture.view_images import ViewImages, view_images
from styletrf.capture.views import load_views, places_of, split_sources
from styletrf.evaluation.quality import views_that_count
from styletrf.field.kernels import Kernels
from styletrf.field.pixel_rays import pixel_rays
from styletrf.field.radiance_field import RadianceField
from styletrf.field.rendering import RenderConfig, render_rays
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.field_training import train_field
from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
from styletrf.field.training.observed_depths import ObservedDepths, observed_depths
from styletrf.field.training.view_exposures import view_exposures
from styletrf.field.view_rays import ViewRays
from styletrf.geometry.cameras import Camera
from styletrf.psnr import psnr_of_error
from styletrf.scene.free_space import free_space
from styletrf.scene.scene_model import SceneModel
from styletrf.scene.training_photographs import TrainingPhotographs

GAIN_RATIO = 0.65
BRIEF = (1 / 16, 1 / 8)  # of the iterations of the whole fit
_RAYS_A_VIEW = 4096
_FEWEST_PLACES = 2  # of the views that are fitted: one place has no parallax
_LEAST_REFRESHES = 8  # of the occupancy


@dataclass(frozen=True, slots=True)
class BriefFit:
    """The iterations of a fit, and the mean PSNR in dB of views that it did not see."""

    iterations: int
    psnr_db: float


def extrapolated_psnr(
    half_db: float, brief_db: float, doublings: float, ratio: float = GAIN_RATIO
) -> float:
    """Returns the PSNR in dB after so many doublings of the iterations of a brief fit.

    Args:
        half_db: The PSNR after half of its iterations.
        brief_db: The PSNR after all of them.
        doublings: At least 0; need not be whole.
        ratio: The ratio of one gain to that before it, in (0, 1).
    """
    gains: float = ratio * (1 - ratio**doublings) / (1 - ratio)  # in units of the last gain
    return brief_db + gains * (brief_db - half_db)


def expected_psnr(
    photographs: TrainingPhotographs,
    model: SceneModel,
    config: FieldTrainingConfig,
    kernels: Kernels,
    device: torch.device,
) -> float | None:
    """Returns the PSNR in dB that a fit of these photographs will have on other views.

    Every eighth of the photographs, or one of fewer than twelve, is set aside for the measurement;
    views of one panorama count as one. Views held out have no part in it. None where fewer than two
    photographs or panoramas, which have no parallax, are left to fit to, or masks leave nothing of
    the others.

    Args:
        photographs: The photographs to fit to.
        model: The model of the scene.
        config: The settings of the whole fit.
        kernels: The kernels for the device.
        device: The device to fit on.
    """
    fits = brief_fits(photographs, model, config, kernels, device)
    if not fits:
        return None
    half, brief = fits
    doublings = math.log2(config.iterations / brief.iterations)
    return extrapolated_psnr(half.psnr_db, brief.psnr_db, doublings)


def brief_fits(
    photographs: TrainingPhotographs,
    model: SceneModel,
    config: FieldTrainingConfig,
    kernels: Kernels,
    device: torch.device,
    fractions: Sequence[float] = BRIEF,
) -> list[BriefFit]:
    """Returns fits of fractions of the iterations; none where `expected_psnr` returns None."""
    places = places_of(photographs.cameras)
    fitted_rows, validation_rows = split_sources(places)
    held_back = model.normalized([photographs.cameras[row] for row in validation_rows])
    cameras, views = views_that_count(held_back, load_views(photographs.folder, held_back, device))
    if len({places[row] for row in fitted_rows}) < _FEWEST_PLACES or not cameras:
        return []
    images = view_images(views)
    fitted = TrainingPhotographs(
        photographs.folder,
        [photographs.cameras[row] for row in fitted_rows],
        photographs.points.of_images(fitted_rows),
    )
    depths = observed_depths(model, fitted.cameras, fitted.points, fitted.images(), fitted.masks())
    fits = []
    for fraction in fractions:
        iterations = max(round(fraction * config.iterations), 1)
        field = _fitted(fitted, depths, model, shortened(config, iterations), kernels, device)
        fits.append(BriefFit(iterations, _psnr(field, model, cameras, images, kernels)))
    return fits


def shortened(config: FieldTrainingConfig, iterations: int) -> FieldTrainingConfig:
    """Returns the settings of a fit that has so few iterations in any case."""
    refresh = min(config.occupancy_every, max(iterations // _LEAST_REFRESHES, 1))
    whole = replace(config, early_gain_db=0.0, shrink_rise=0.0)
    return replace(whole, iterations=iterations, occupancy_every=refresh)


def _fitted(
    photographs: TrainingPhotographs,
    depths: ObservedDepths,
    model: SceneModel,
    config: FieldTrainingConfig,
    kernels: Kernels,
    device: torch.device,
) -> RadianceField:
    cameras, points = model.normalized(photographs.cameras), photographs.points
    images = load_views(photographs.folder, cameras, device)
    exposures = view_exposures(photographs.cameras, model.exposures, device)
    free = torch.from_numpy(free_space(model, photographs.cameras, points))
    views = TrainingViews(cameras, images, depths, exposures)
    volume = FieldVolume(model.space, model.resolution, free)
    return train_field(views, volume, config, kernels)[0]


@torch.no_grad()
def _psnr(
    field: RadianceField,
    model: SceneModel,
    cameras: Sequence[Camera],
    images: ViewImages,
    kernels: Kernels,
) -> float:
    """Returns the mean over views of their PSNR, each at pixels drawn from it.

    Rays are rendered a tile at a time: those of many views would fill the memory.
    """
    generator = torch.Generator().manual_seed(0)
    pixels = images.drawn(_RAYS_A_VIEW * len(cameras), generator)
    rays = ViewRays(cameras, model.space.within(field.bounds), field.step_length, images.device)
    config, parts = RenderConfig(), []
    for tile in pixels.split(config.tile):
        segments, target = pixel_rays(rays, images, tile)
        color = render_rays(field, kernels, segments, config).color
        parts.append((color - target).square().mean(dim=1))
    errors = _means_by_view(torch.cat(parts), images.places(pixels)[0])
    return sum(map(psnr_of_error, errors)) / len(errors)


def _means_by_view(error: Float[Tensor, " rays"], view: Int64[Tensor, " rays"]) -> list[float]:
    """Returns the mean of each view that has any."""
    return [float(error[view == k].mean()) for k in view.unique()]
