"""Settings with which a stylization cannot work are refused before anything is made."""

import pytest
from expected_errors import rejects

from styletrf.configuration import configured
from styletrf.evaluation.quality import QualityConfig
from styletrf.evaluation.stylization_loss import StylizationLossConfig
from styletrf.field.rendering import RenderConfig
from styletrf.style.gatys import GatysConfig
from styletrf.style.training.config import StyleTrainingConfig
from styletrf.style.transfer.network import TransferNetworkConfig
from styletrf.stylization.priors import PriorsConfig
from styletrf.stylization.strategies import StylizationConfig


@pytest.mark.parametrize(
    ("config", "name", "value"),
    [
        (StylizationConfig, "style_px", 15),
        (StylizationConfig, "stroke_scale", 0.0),
        (StylizationConfig, "image.iterations", -1),
        (StylizationConfig, "image.window_px", 15),
        (StylizationConfig, "image.rate_decay", 1.5),
        (StylizationConfig, "image.min_weight", 1.0),
        (StylizationConfig, "image.termination", 1.0),
        (StylizationConfig, "adaptation.rate_decay", 0.0),
        (StylizationConfig, "adaptation.min_weight", 1.0),
        (StylizationConfig, "adaptation.termination", -0.1),
        (StylizationConfig, "weight_power.powers", (1.0, 9.0)),
        (StylizationConfig, "adaptation.factor_rate", 0.0),
        (StylizationConfig, "adaptation.network_rate", 0.0),
        (StylizationConfig, "image.rate", 0.0),
        (GatysConfig, "rate", 0.0),
        (GatysConfig, "style_px", 0),
        (GatysConfig, "style_px", 15),
        (GatysConfig, "iterations", ()),
        (GatysConfig, "iterations", (5, -1)),
        (StylizationLossConfig, "style_px", 7),
        (StylizationLossConfig, "frames", 0),
        (PriorsConfig, "long_side_px", 63),
        (PriorsConfig, "long_side_px", -1),
        (PriorsConfig, "long_side_px", 3841),
        (PriorsConfig, "frames_per_second", 23),
        (PriorsConfig, "render.tile", 0),
        (PriorsConfig, "render.termination", 1.0),
        (PriorsConfig, "render.min_weight", 1.5),
        (PriorsConfig, "coverage.count", -1),
        (PriorsConfig, "coverage.times", 0),
        (PriorsConfig, "coverage.share", 0.0),
        (PriorsConfig, "coverage.once", 1.5),
        (QualityConfig, "long_side_px", -1),
        (QualityConfig, "long_side_px", 10),
        (QualityConfig, "perceptual_px", 7),
        (StyleTrainingConfig, "normalization_rate", 0.0),
        (StyleTrainingConfig, "network.width", 0),
        (StyleTrainingConfig, "network.n_residual", -1),
        (StyleTrainingConfig, "temporal_loss.every", 0),
        (StyleTrainingConfig, "temporal_loss.renders", 1.5),
        (TransferNetworkConfig, "widths", (8, 0, 32)),
        (TransferNetworkConfig, "n_residual", -1),
    ],
)
def test_a_setting_out_of_range_is_refused_by_its_name_and_value(config, name, value):
    with rejects(f"setting {name!r}", name.rpartition(".")[2], str(value)) as caught:
        configured(config, {name: value})
    assert "Config(" not in caught.value.problem


def test_a_fit_of_the_network_that_plain_shading_lacks_is_refused():
    """It ended in a traceback, after the field."""
    values = {"adaptation.parts": ["network"]}
    with rejects("setting 'adaptation.parts'", "network", "'plain'"):
        configured(StylizationConfig, values)
    configured(StylizationConfig, {**values, "shading": "network"})


def test_the_smallest_values_that_work_are_accepted():
    values = {"style_px": 16, "image.iterations": 0}
    configured(RenderConfig, {"tile": 1, "termination": 0.0, "min_weight": 0.0})
    configured(GatysConfig, {"iterations": [0]})
    configured(StylizationConfig, values)
    configured(PriorsConfig, {"long_side_px": 64})
    assert configured(PriorsConfig, {"long_side_px": 0}).long_side_px == 0
    configured(StylizationLossConfig, {"style_px": 8})
    configured(GatysConfig, {"style_px": 16})
    assert configured(QualityConfig, {"long_side_px": 0}).long_side_px == 0
