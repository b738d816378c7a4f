"""The graph of StyleTRF as Luigi tasks; `luigi --module tasks StylizedTrajectory ...`.

    SceneCapture - CameraPoses - SceneModel - RadianceField -+- PriorRenders - StylizedPriors
                                                             +- QualityMetrics        |
    ContentImages, PerceptualWeights, StyleImage             +- TrajectoryFrames      |
              `- StyleNetwork - StylizedPriors - StylizedField - StylizedFrames - ConsistencyMetrics
                                                                              `- StyleMetrics

PriorRenders needs TrajectoryFrames, too: priors show what the path sees. `SceneReport` looks at a
scene before the fit; `TradeOff` measures what its settings cost and buy. `TransferWeights` are the
networks of arbitrary style transfer.

A task gathers its inputs, calls the library and writes what it returns. Importing this package
loads no torch: heavy imports stand inside `build`, which runs in an interpreter of its own.
"""

from pipeline.command import take_over_luigi
from tasks.command_line import begin, end
from tasks.field import PriorRenders, RadianceField, TrajectoryFrames
from tasks.grid import Grid
from tasks.metrics import ConsistencyMetrics, QualityMetrics, StyleMetrics, StylizationMetrics
from tasks.preflight import SceneReport
from tasks.scene import CameraPoses, SceneCapture, SceneModel
from tasks.style import (
    ContentImages,
    PerceptualWeights,
    StyleImage,
    StyleNetwork,
    TransferWeights,
)
from tasks.stylization import StylizedField, StylizedFrames, StylizedPriors
from tasks.trade_off import TradeOff
from tasks.trajectory import StylizedTrajectory

__all__ = [
    "CameraPoses",
    "ConsistencyMetrics",
    "ContentImages",
    "Grid",
    "PerceptualWeights",
    "PriorRenders",
    "QualityMetrics",
    "RadianceField",
    "SceneCapture",
    "SceneModel",
    "SceneReport",
    "StyleImage",
    "StyleMetrics",
    "StyleNetwork",
    "StylizationMetrics",
    "StylizedField",
    "StylizedFrames",
    "StylizedPriors",
    "StylizedTrajectory",
    "TradeOff",
    "TrajectoryFrames",
    "TransferWeights",
]

take_over_luigi(begin, end)  # of `luigi --module tasks ...`; other imports go on
