"""The qualities are settings that stages take; `paper` has the numbers of docs/paper.md."""

import pytest

from styletrf.configuration import configured
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.scene.scene_model import SceneModelConfig
from styletrf.stylization.priors import PriorsConfig
from tasks.planning.request_validation import configurations
from tasks.presets.presets import PRESETS, settings_for


@pytest.mark.parametrize("quality", PRESETS)
def test_every_setting_of_a_quality_is_one_of_its_stage(quality):
    for family, config in configurations().items():
        assert configured(config, settings_for(family, quality)) is not None


def test_the_publication_has_48_components_and_total_variation_of_ten_to_one():
    config = configured(FieldTrainingConfig, settings_for("RadianceField", "paper"))
    assert sum(config.field.density_ranks) + sum(config.field.appearance_ranks) == 48
    assert config.tv_density == pytest.approx(10 * config.tv_appearance)


def test_the_publications_lattice_grows_every_thousand_iterations():
    config = configured(FieldTrainingConfig, settings_for("RadianceField", "paper"))
    assert (config.iterations, config.batch) == (15_000, 4096)
    assert config.upsample_steps == (2000, 3000, 4000, 5000)


def test_the_publications_field_has_its_last_parameters_at_a_tenth_of_the_first_rate():
    config = configured(FieldTrainingConfig, settings_for("RadianceField", "paper"))
    assert (config.average_share, config.rate_decay) == (0.0, 0.1)


def test_a_box_of_the_publication_has_a_bound_of_its_own():
    config = configured(SceneModelConfig, settings_for("SceneModel", "paper"))
    assert config.bound("box") == 300**3
    assert config.bound("ndc") == config.bound("unbounded") == 640**3


@pytest.mark.parametrize("quality", ["draft", "standard"])
def test_without_a_bound_of_its_own_a_box_has_that_of_any_space(quality):
    config = configured(SceneModelConfig, settings_for("SceneModel", quality))
    assert config.bound("box") == config.bound("ndc") == config.max_voxels


def test_the_publications_priors_lie_along_the_path():
    config = configured(PriorsConfig, settings_for("PriorRenders", "paper"))
    assert config.viewpoints == "path"
    assert config.coverage.count == config.trajectory.frames == 30
