"""What is not finite stops the computation that meets it first, with tensor and input."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from expected_errors import stops
from mini_scene import MINI_FIT as CONFIG

from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField
from styletrf.field.rendering import RenderConfig
from styletrf.field.training.trainer import FieldTrainer
from styletrf.finiteness import parameter_stages, require_finite
from styletrf.geometry.camera_table import read_cameras, write_cameras
from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model
from styletrf.stylization.adaptation import AdaptationConfig, adapt_appearance
from styletrf.stylization.image_adaptation import ImageAdaptationConfig, adapt_to_image_loss
from styletrf.trajectory.frames import rendered

CPU = torch.device("cpu")
KERNELS = kernels_for(CPU)
SMALL = replace(CONFIG.field, density_ranks=(2, 2, 2), appearance_ranks=(2, 2, 2))
STEPS = AdaptationConfig(iterations=3, batch=64)


@pytest.fixture
def field():
    return RadianceField(SMALL, (6, 6, 6), torch.Generator().manual_seed(0))


def spoilt_gradient(parameter: torch.nn.Parameter, at: int) -> None:
    """Makes the gradient NaN the `at`-th time that there is one."""
    times = iter(range(1000))
    parameter.register_hook(lambda grad: grad * (torch.nan if next(times) == at else 1.0))


def test_the_first_of_causes_is_named_and_infinity_counts():
    fine, bad = torch.ones(2), torch.tensor([1.0, torch.inf])
    require_finite("a stage", "here", [("fine", fine)])
    with stops("a stage", "cause", "here"):
        require_finite("a stage", "here", [("fine", fine), ("cause", bad), ("effect", bad)])


def test_a_gradient_whose_square_overflows_is_named():
    """Adam divides by an infinite root: no step would ever move the parameter again."""
    module = torch.nn.Linear(2, 1)
    optimizer = torch.optim.Adam(module.parameters())
    (1e25 * module.weight.sum() + module.bias.sum()).backward()
    optimizer.step()
    with stops("a fit", "squared gradient of weight", "now"):
        require_finite("a fit", "now", parameter_stages(module, optimizer))


def renders_of(scene, field, cameras=None):
    cameras = cameras or scene.cameras
    return list(rendered(field, scene.model.space, cameras, RenderConfig(), CPU))


def test_a_render_names_the_view_and_the_parameter(scene, field):
    with torch.no_grad():
        field.appearance.background[1] = torch.nan
    with stops("rendering", "parameter background", "in view 0"):
        renders_of(scene, field)


def test_a_sky_at_infinity_is_rendered(scene, field):
    field.density.scale = 0.0
    renders = renders_of(scene, field)
    assert len(renders) == len(scene.cameras)
    assert all(torch.isposinf(render.depth).all() for render in renders)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_camera_that_is_not_finite_is_neither_rendered_nor_stored(scene, field, tmp_path, value):
    bad = replace(scene.cameras[1], fx=value)
    with stops("rays", "camera 1", f"in space {scene.model.space.kind}"):
        renders_of(scene, field, [scene.cameras[0], bad])
    with stops("cameras", "camera 1", "in a.parquet"):
        write_cameras(tmp_path / "a.parquet", [bad])
    write_cameras(tmp_path / "a.parquet", scene.cameras)
    assert len(read_cameras(tmp_path / "a.parquet")) == len(scene.cameras)


def test_a_scene_of_points_that_are_not_finite_is_refused(scene):
    points = np.random.default_rng(0).uniform(1, 2, (50, 3))
    points[7, 2] = np.nan
    with stops("scene model", "sparse points", "as it was given"):
        decide_scene_model(scene.cameras, points, SceneModelConfig())


def adapt(scene, field, config=STEPS):
    space = scene.model.space
    adapt_appearance(field, scene.cameras, scene.images, space, config, KERNELS)


def test_an_adaptation_names_a_density_that_is_not_finite(scene, field):
    with torch.no_grad():
        field.density.factors.planes[0][:] = torch.nan
    with stops("appearance adaptation", "weights of samples", "at iteration 0"):
        adapt(scene, field)


@pytest.mark.parametrize(
    ("at", "where"), [(0, "at iteration 1"), (2, "after the last iteration")]
)  # fmt: skip
def test_an_adaptation_names_a_gradient_of_the_last_iteration_too(scene, field, at, where):
    spoilt_gradient(field.appearance.background, at)
    with stops("appearance adaptation", "gradient of background", where):
        adapt(scene, field, replace(STEPS, tv_every=1000))


class EndlessLoss:
    """A loss of renders that is infinite."""

    def content_features(self, plain):
        return plain

    def __call__(self, image, content, generator):
        return image.sum() * torch.inf


def test_an_adaptation_to_images_names_the_view(scene, field):
    views = (scene.images[:1], scene.images[:1])
    with stops("appearance adaptation", "image loss", "at iteration 0, view 0"):
        adapt_to_image_loss(
            field, scene.cameras[:1], views, scene.model.space,
            EndlessLoss(), ImageAdaptationConfig(2), STEPS, KERNELS,
        )  # fmt: skip


def test_a_finished_field_whose_loss_is_not_finite_stops(scene):
    trainer = FieldTrainer(scene.views(), scene.volume, CONFIG, KERNELS)
    with torch.no_grad():
        trainer.field.appearance.background.fill_(torch.nan)
    with stops("field training", "loss of the field", "at iteration 0"):
        trainer.loss(trainer.field)
