"""A fit stops at what is not finite and names it, and stays finite where little is to be seen."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from expected_errors import stops
from mini_scene import MINI_FIT, fit

from styletrf.field.kernels import kernels_for
from styletrf.field.training.field_training import train_field
from styletrf.field.training.fit_inputs import TrainingViews
from styletrf.field.training.trainer import FieldTrainer
from styletrf.files.checkpoints import load_checkpoint

CPU = torch.device("cpu")
KERNELS = kernels_for(CPU)


def test_what_is_not_finite_stops_the_training(scene):
    config = replace(MINI_FIT, factor_rate=1e30, network_rate=1e30, iterations=20)
    with stops("field training", "density", "at iteration 1"):
        fit(scene, config)


def infinity_less_infinity(trainer: FieldTrainer) -> None:
    for k, sign in ((0, 1), (1, -1)):
        trainer.field.density.factors.lines[k].data.fill_(100)
        trainer.field.density.factors.planes[k].data.fill_(sign * torch.finfo().max)


@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        (lambda t: first_plane(t).fill_(torch.nan), "parameter density.factors.planes.0"),
        (infinity_less_infinity, "density"),
        (lambda t: color_plane(t).fill_(torch.finfo().max), "features"),
        (lambda t: background(t).fill_(torch.nan), "parameter appearance.background"),
        (lambda t: t.field.appearance.shading.hidden.weight.data.fill_(3e38), "color"),
    ],
)  # fmt: skip
def test_the_first_stage_that_is_not_finite_is_named_and_the_state_saved(
    scene, tmp_path: Path, spoil, named
):
    trainer = FieldTrainer(scene.views(), scene.volume, MINI_FIT, KERNELS, tmp_path)
    trainer.step()
    spoil(trainer)
    with stops("field training", named, "at iteration 1"):
        trainer.step()
    assert load_checkpoint(tmp_path / "not_finite", CPU) is not None
    assert load_checkpoint(tmp_path, CPU) is None


def first_plane(trainer: FieldTrainer) -> torch.Tensor:
    return trainer.field.density.factors.planes[0].data


def color_plane(trainer: FieldTrainer) -> torch.Tensor:
    trainer.field.appearance.factors.lines[0].data.fill_(100)
    return trainer.field.appearance.factors.planes[0].data


def background(trainer: FieldTrainer) -> torch.Tensor:
    return trainer.field.appearance.background.data


def test_a_camera_that_is_not_finite_is_named(scene):
    nowhere = replace(scene.cameras[1], world_from_camera=np.full((3, 4), np.nan))
    views = TrainingViews([scene.cameras[0], nowhere], scene.images[:2])
    with stops("rays", "camera 1", f"in space {scene.model.space.kind}"):
        FieldTrainer(views, scene.volume, MINI_FIT, KERNELS)


def test_a_gradient_that_was_not_finite_is_named_before_the_parameter_it_spoilt(scene):
    trainer = FieldTrainer(scene.views(), scene.volume, MINI_FIT, KERNELS)
    trainer.field.appearance.shading.basis.weight.register_hook(lambda grad: grad * torch.nan)
    trainer.step()
    with stops("field training", "gradient of appearance.shading.basis.weight", "at iteration 1"):
        trainer.step()


def test_one_view_and_a_white_scene_stay_finite(scene):
    white = TrainingViews(scene.cameras[:1], torch.full_like(scene.images[:1], 255))
    field, _ = train_field(white, scene.volume, replace(MINI_FIT, iterations=50), KERNELS)
    assert all(torch.isfinite(p).all() for p in field.parameters())
