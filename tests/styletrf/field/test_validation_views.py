"""Validation views: none of their pixels is fitted to, and what they gain decides a fit's end."""

from dataclasses import replace

import pytest
import torch
from mini_scene import KERNELS, MINI_FIT, MiniScene, painted_plane

from styletrf.field.training.checkpoint import save_fit
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.field_training import train_field
from styletrf.field.training.trainer import FieldTrainer

CONFIG = replace(MINI_FIT, iterations=60, upsample_at=(0.1, 0.3))
BEFORE, AFTER, EARLY = 24, 30, 36  # iterations, one to three tenths after the last growth
LATE = 75
SHORT = replace(CONFIG, iterations=20)


@pytest.fixture(scope="module")
def many() -> MiniScene:
    return painted_plane(20)


def trainer_of(scene: MiniScene, config: FieldTrainingConfig, **more) -> FieldTrainer:
    return FieldTrainer(scene.views(), scene.volume, config, KERNELS, **more)


def fitted(scene: MiniScene, config: FieldTrainingConfig):
    return train_field(scene.views(), scene.volume, config, KERNELS)


def spoilt(scene: MiniScene) -> MiniScene:
    """The scene with noise in place of the validation views."""
    images = scene.images.clone()
    noise = torch.randint(0, 256, images[5::10].shape, generator=torch.Generator().manual_seed(0))
    images[5::10] = noise.byte()
    return replace(scene, images=images)


def test_validation_views_have_no_part_in_the_fit_before_they_are_measured(many):
    whole = replace(CONFIG, early_gain_db=-1e3)  # both have the same learning rates
    parts = [trainer_of(scene, whole) for scene in (many, spoilt(many))]
    for trainer in parts:
        trainer.field.appearance.background.data.zero_()  # the mean of what misses the grid
    for _ in range(AFTER - 1):
        parts[0].step(), parts[1].step()
    found, expected = (trainer.field.state_dict() for trainer in parts)
    torch.testing.assert_close(found, expected, rtol=0, atol=0)
    for _ in range(2):
        parts[0].step(), parts[1].step()
    assert (
        not parts[0]
        .field.appearance.factors.planes[0]
        .equal(parts[1].field.appearance.factors.planes[0])
    ), "from then on they have"


def test_a_batch_has_no_pixels_of_validation_views_but_is_never_empty(many):
    """A loss of no pixels is not finite."""
    trainer = trainer_of(many, CONFIG)
    validation, images = trainer.validation, trainer.images
    own, other = images.of_view(5)[:3], images.of_view(4)[:2]
    assert torch.equal(validation.without(images, torch.cat([own, other])), other)
    assert torch.equal(validation.without(images, own), own)


@pytest.mark.parametrize(
    ("early_db", "steep_db", "iterations"),
    [
        (1e3, 0.0, 12),
        (1e3, -1e3, 12),
        (-1e3, 0.0, 20),
        (-1e3, 1e3, 20),
        (-1e3, -1e3, 25),
        (0.0, -1e3, 20),
    ],
)
def test_a_fit_is_shorter_without_gain_and_longer_with_much_of_it(
    many, early_db, steep_db, iterations
):
    config = replace(SHORT, early_gain_db=early_db, steep_gain_db=steep_db)
    trainer = trainer_of(many, config)
    while trainer.state.iteration < trainer.state.end:
        trainer.step()
    assert trainer.state.iteration == iterations


def test_a_longer_fit_is_the_planned_one_that_goes_on(many):
    """So that its parameters depend on the scene alone, and not on when it was asked for more."""
    longer, planned = (
        trainer_of(many, replace(CONFIG, early_gain_db=-1e3, steep_gain_db=steep_db))
        for steep_db in (-1e3, 1e3)
    )
    for _ in range(CONFIG.iterations):
        longer.step(), planned.step()
    assert (longer.state.end, planned.state.end) == (LATE, CONFIG.iterations)
    found, expected = (trainer.field.state_dict() for trainer in (longer, planned))
    torch.testing.assert_close(found, expected, rtol=1e-4, atol=1e-6)


def test_noise_that_no_field_explains_ends_a_fit(many):
    """What is learned of the other views does not help to see noise."""
    trainer = trainer_of(spoilt(many), CONFIG)
    while trainer.state.iteration < trainer.state.end:
        trainer.step()
    assert trainer.state.iteration == EARLY


def test_few_views_are_all_fitted_to():
    assert trainer_of(painted_plane(14), CONFIG).validation is None
    assert trainer_of(painted_plane(16), CONFIG).validation is not None


def test_views_of_a_panorama_are_validation_views_together(many):
    """Each shows at its margins what the others do, from the same place."""
    cameras = list(many.cameras)
    cameras[6] = replace(cameras[6], world_from_camera=cameras[5].world_from_camera)
    validation = trainer_of(replace(many, cameras=cameras), CONFIG).validation
    assert validation.views.nonzero()[:, 0].tolist() == [5, 6, 16]


@pytest.fixture(scope="module")
def early(many):
    """The field of a fit to noise that nothing stopped."""
    return fitted(spoilt(many), CONFIG)[0]


@pytest.mark.parametrize("killed_at", [BEFORE + 3, AFTER + 2])
def test_a_fit_that_ends_early_resumes_to_the_same_parameters(many, early, tmp_path, killed_at):
    """Between the measurements, too: without the first, the second would count as a gain."""
    scene = spoilt(many)
    killed = trainer_of(scene, CONFIG, checkpoint_dir=tmp_path)
    for _ in range(killed_at):
        killed.step()
    save_fit(tmp_path, killed)
    resumed = trainer_of(scene, CONFIG, checkpoint_dir=tmp_path)
    assert resumed.state.iteration == killed_at
    while resumed.state.iteration < resumed.state.end:
        resumed.step()
    assert resumed.state.iteration == EARLY
    resumed.finish()
    torch.testing.assert_close(resumed.field.state_dict(), early.state_dict(), rtol=1e-4, atol=1e-6)


def test_a_longer_fit_resumes_after_its_planned_end_to_the_same_parameters(many, tmp_path):
    config = replace(CONFIG, early_gain_db=-1e3, steep_gain_db=-1e3)
    whole, _ = fitted(many, config)
    killed = trainer_of(many, config, checkpoint_dir=tmp_path)
    for _ in range(config.iterations + 5):
        killed.step()
    save_fit(tmp_path, killed)
    resumed = trainer_of(many, config, checkpoint_dir=tmp_path)
    while resumed.state.iteration < resumed.state.end:
        resumed.step()
    assert resumed.state.iteration == LATE
    resumed.finish()
    torch.testing.assert_close(resumed.field.state_dict(), whole.state_dict(), rtol=1e-4, atol=1e-6)


def test_validation_views_that_are_masked_all_over_are_not_measured(many):
    alpha = torch.full((*many.images.shape[:3], 1), 255, dtype=torch.uint8)
    alpha[5::10] = 0
    images = torch.cat([many.images, alpha], dim=3)
    assert trainer_of(many, CONFIG).validation is not None
    assert trainer_of(replace(many, images=images), CONFIG).validation is None
