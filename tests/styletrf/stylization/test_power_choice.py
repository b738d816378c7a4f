"""The lowest power of the weights with which frames are as crisp as their priors."""

import re
from dataclasses import replace

import numpy as np
import pytest
import torch
from mini_scene import MINI_FIT as CONFIG
from mini_scene import fit

from styletrf.evaluation.sharpness import sharpness
from styletrf.stylization.power_choice import PowerChoiceConfig, choose_weight_power
from styletrf.trajectory.frames import rendered


@pytest.fixture(scope="module")
def field(scene):
    return fit(scene, replace(CONFIG, iterations=30))


def chosen(scene, field, painted, **words):
    config = PowerChoiceConfig(**words)
    power = choose_weight_power(field, scene.cameras, painted, scene.model.space, config)
    assert field.appearance.weight_power == power
    return power


def test_soft_priors_need_no_power(scene, field):
    ramp = torch.linspace(0, 255, scene.images.shape[2])[None, None, :, None]
    assert chosen(scene, field, ramp.expand_as(scene.images).to(torch.uint8)) == 1


def test_priors_sharper_than_any_render_get_the_highest(scene, field):
    board = 255 * (torch.arange(scene.images[..., 0].numel()) % 2)
    board = board.reshape(scene.images.shape[:3])[..., None].expand_as(scene.images)
    assert chosen(scene, field, board.to(torch.uint8), powers=(1.0, 3.0)) == 3


def test_the_lowest_power_that_is_sharp_enough_is_taken(scene, field):
    """What is enough is set between what two powers reach."""
    reached = []
    for power in (1.0, 2.0, 4.0):
        field.appearance.weight_power = power
        shown = rendered(
            field, scene.model.space, scene.cameras, PowerChoiceConfig().render, scene.images.device
        )
        reached.append(np.mean([sharpness(render.color.numpy()) for render in shown]))
    assert reached == sorted(reached), "weights to a higher power draw sharper frames"
    wanted = np.mean([sharpness(image.numpy() / np.float32(255)) for image in scene.images])
    enough = float((reached[0] + reached[1]) / 2 / wanted)
    words = {"powers": (1.0, 2.0, 4.0), "sharpness": enough, "views": len(scene.cameras)}
    assert chosen(scene, field, scene.images, **words) == 2


def test_a_single_power_is_taken_unseen(scene, field):
    assert chosen(scene, field, scene.images, powers=(1.25,)) == 1.25


@pytest.mark.parametrize("powers", [(), (0.5, 1.0), (2.0, 1.0), (1.0, 8.5)])
def test_powers_that_do_not_ascend_from_1_to_8_are_refused(powers):
    with pytest.raises(ValueError, match=rf"powers\b.*{re.escape(str(powers))}"):
        PowerChoiceConfig(powers=powers)
