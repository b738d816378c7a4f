"""From coarse to fine."""

import itertools
import math

import numpy as np
import pytest

from styletrf.field.field_config import FieldConfig
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.schedule import decay, march_step, stage_resolution
from styletrf.geometry.space import Space


def test_the_grid_grows_geometrically_to_the_final_resolution():
    final = (300, 200, 100)
    stages = [stage_resolution(final, 10**3, k, 4) for k in range(5)]
    assert stages[-1] == final
    ratios = [math.prod(b) / math.prod(a) for a, b in itertools.pairwise(stages)]
    assert ratios == pytest.approx([(300 * 200 * 100 / 1000) ** 0.25] * 4, rel=0.15)


def test_without_stages_the_grid_is_final_from_the_start():
    assert stage_resolution((30, 20, 10), 8, 0, 0) == (30, 20, 10)


def test_a_grid_never_starts_finer_than_it_ends():
    assert stage_resolution((8, 8, 8), 64**3, 0, 3) == (8, 8, 8)


def test_a_step_divides_a_voxel():
    cube = Space("box", np.eye(4)[None], (1.0, 1.0, 1.0), depth_min=0.1)
    assert march_step(cube, (11, 11, 11), 2.0) == pytest.approx(0.1)


def test_decay_falls_from_one_to_its_ratio():
    assert decay(0.1, 0, 10) == 1
    assert decay(0.1, 10, 10) == pytest.approx(0.1)
    assert decay(0.1, 5, 10) == pytest.approx(0.1**0.5)


def test_only_steps_of_ndc_are_longer():
    config = FieldTrainingConfig(steps_per_voxel=0.6, ndc_step=1.5)
    assert config.steps_in("ndc") == pytest.approx(0.4)
    assert config.steps_in("box") == config.steps_in("unbounded") == 0.6


@pytest.mark.parametrize(
    "name", ["iterations", "batch", "initial_voxels", "tv_views", "tv_every", "occupancy_every"]
)
def test_counts_below_one_are_refused(name):
    with pytest.raises(ValueError, match=name):
        FieldTrainingConfig(**{name: 0})


@pytest.mark.parametrize(
    ("name", "value"), [("hidden", 0), ("features", 0), ("initial_raw_density", -0.1)]
)
def test_sizes_of_a_field_that_cannot_work_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        FieldConfig(**{name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [("min_weight", 1.0), ("termination", 1.0), ("rate_decay", 0.0), ("rate_decay", 1.5),
     ("occupancy_alpha", -0.1), ("occupancy_alpha", 1.0), ("factor_rate", 0.0),
     ("network_rate", 0.0), ("tv_density", -0.1), ("tv_appearance", -0.1)],
)  # fmt: skip
def test_fractions_rates_and_weights_out_of_range_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        FieldTrainingConfig(**{name: value})


def test_the_grid_grows_before_the_last_iteration_ends():
    """Else the finished grid would be as coarse as that of the stage before."""
    config = FieldTrainingConfig(iterations=10, upsample_at=(0.01, 0.5, 0.99))
    assert config.upsample_steps == (1, 5, 9)


@pytest.mark.parametrize("name", ["steps_per_voxel", "ndc_step"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_steps_without_a_length_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        FieldTrainingConfig(**{name: value})
