"""A field fitted to photographs of different exposures has the middle one."""

from dataclasses import replace

import numpy as np
import torch
from mini_scene import MINI_FIT, MiniScene

from styletrf.evaluation.metrics import psnr
from styletrf.field.kernels import kernels_for
from styletrf.field.rendering import RenderConfig, render_view
from styletrf.field.training.field_training import train_field
from styletrf.field.training.view_exposures import ViewExposures
from styletrf.field.view_rays import ViewRays

CPU = torch.device("cpu")
CONFIG = replace(
    MINI_FIT,
    field=replace(MINI_FIT.field, shading="plain"),
    iterations=150,
    shrink_rise=0.01,
)


def fitted_psnr(
    scene: MiniScene, images: torch.Tensor, exposures: ViewExposures | None, config=CONFIG
) -> tuple[float, float]:
    """Returns the PSNR of a view against the scene as it is, and of the rays of training."""
    kernels, views = kernels_for(CPU), replace(scene.views(exposures=exposures), images=images)
    field, curve = train_field(views, scene.volume, config, kernels)
    rays = ViewRays(scene.cameras, scene.model.space, field.step_length, CPU)
    render = render_view(field, kernels, rays, 2, scene.cameras[2], RenderConfig())
    return psnr(render.color.numpy(), (scene.images[2].float() / 255).numpy()), curve[-1].psnr


def test_the_field_has_the_middle_exposure_and_fits_every_view(scene):
    rng = np.random.default_rng(0)
    views = len(scene.images)
    log_gain = torch.from_numpy(rng.uniform(-0.4, 0.4, (views, 3))).float()
    exposures = ViewExposures(log_gain, torch.ones(views, 3))
    shown = scene.images / 255 * log_gain.exp()[:, None, None]
    images = (255 * shown.clamp(0, 1)).round().to(torch.uint8)
    without, trained_without = fitted_psnr(scene, images, None)
    with_them, trained_with = fitted_psnr(scene, images, exposures)
    assert with_them > without + 3
    assert trained_with > trained_without + 3


def test_the_identity_fits_as_no_exposure_does(scene):
    views = len(scene.images)
    identity = ViewExposures(torch.zeros(views, 3), torch.ones(views, 3))
    short = replace(CONFIG, iterations=60)
    plain, exposed = (fitted_psnr(scene, scene.images, e, short)[0] for e in (None, identity))
    assert abs(plain - exposed) < 1
