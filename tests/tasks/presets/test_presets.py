"""The qualities are settings that stages take; `paper` has the numbers of docs/paper.md."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from expected_errors import rejects

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


def settings_of(config: Any, inside: str = "") -> Iterator[str]:
    """The names of all settings of a configuration and of those inside it."""
    for each in dataclasses.fields(config):
        value = getattr(config, each.name)
        if dataclasses.is_dataclass(value):
            yield from settings_of(value, f"{inside}{each.name}.")
        else:
            yield inside + each.name


def settings_ending_in(*ends: str) -> list[tuple[str, str]]:
    """The stages and names of settings that end so."""
    return [
        (family, name)
        for family, config in configurations().items()
        for name in settings_of(config())
        if f"_{name.rpartition('.')[2]}".endswith(ends)
    ]


@pytest.mark.parametrize(("family", "name"), settings_ending_in("_rate", "_weight"))
def test_a_rate_or_a_weight_below_zero_is_refused(family, name):
    """A wrong sign would maximize a loss for a whole fit, or move away from its minimum."""
    with rejects(f"setting {name!r}", name.rpartition(".")[2], "-1.0"):
        configured(configurations()[family], {name: -1.0})


@pytest.mark.parametrize(("family", "name"), settings_ending_in("_seed"))
def test_a_seed_that_a_library_does_not_take_is_refused(family, name):
    """It ended in a traceback, after minutes."""
    for seed in (-1, 2**31, 2**32):
        with rejects(f"setting {name!r}", str(seed)):
            configured(configurations()[family], {name: seed})
    for seed in (0, 2**31 - 1):
        assert configured(configurations()[family], {name: seed}) is not None


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


def test_the_page_beside_the_publication_has_the_values_of_the_preset():
    page = Path(__file__).parents[3] / "docs/paper.md"
    rows = {
        line.split("|")[1].strip(): line for line in page.read_text().splitlines() if "|" in line
    }
    for name, words in words_of_the_preset().items():
        assert words in rows[name], name


def words_of_the_preset() -> dict[str, str]:
    """The values of `paper` as docs/paper.md writes them, by the first column of its table."""
    model, fit, network, priors, field = (
        settings_for(family, "paper")
        for family in (
            "SceneModel",
            "RadianceField",
            "StyleNetwork",
            "PriorRenders",
            "StylizedField",
        )
    )
    ranks = (", ".join(map(str, fit[f"field.{kind}_ranks"])) for kind in ("density", "appearance"))
    content, style = (f"{network[f'loss.{kind}_weight']:.0e}" for kind in ("content", "style"))
    return {
        "field": " and ".join(ranks),
        "lattice": f"at most {side(model['max_box_voxels'])}^3 in a box,"
        f" at most {side(model['max_voxels'])}^3 in other spaces",
        "growth": f"from {side(fit['initial_voxels'])}^3",
        "fit": f"{fit['iterations']:,} iterations of {fit['batch']:,} rays; Adam,"
        f" {fit['factor_rate']:g} for factors, {fit['network_rate']:g} for the network",
        "style network": f"{network['iterations']:,} iterations of {network['batch']} crops of"
        f" {network['crop_px']} pixels, rate {network['learning_rate']:g},"
        f" content {content.replace('e+0', 'e')} at {network['loss.content_layer']},"
        f" style {style.replace('e+', 'e')}",
        "priors": f"{priors['coverage.count']} views evenly along the {priors['viewpoints']}",
        "adaptation": f"{field['adaptation.iterations']:,} iterations of"
        f" {field['adaptation.batch']:,}",
    }


def side(voxels: int) -> int:
    return round(voxels ** (1 / 3))
