"""The graph of StyleTRF as Luigi tasks; `luigi --module tasks StylizedTrajectory ...`.

    SceneCapture - CameraPoses - SceneModel - RadianceField -+- PriorRenders - StylizedPriors
                                                             +- QualityMetrics        |
    ContentImages, PerceptualWeights, StyleImage             +- TrajectoryFrames      |
              `- StyleNetwork - StylizedPriors - StylizedField - StylizedFrames - ConsistencyMetrics
                                                                              `- StyleMetrics

PriorRenders also needs TrajectoryFrames, since priors cover what the path sees. `SceneReport`
surveys a scene before the fit; `TradeOff` measures time and quality of settings. `TransferWeights`
are the networks of arbitrary style transfer. `Grid` requests every style on every scene.

The packages, each of which imports only those below it:

    view                  `styletrf view SCENE`, the viewer while styles are made
    results               the tasks that users request
    summary | planning    what they read afterwards; what a command would build, and its cost
    stages                the stages of the graph
    presets               settings by name, or chosen for a bound on time or quality
    command | machine     the command of this process; the machine it runs on

A stage gathers its inputs, calls the library and writes the result. Importing this package loads
no torch: heavy imports are inside `build`, which runs in its own process. Begin with `stages`, and
with `command_line` for what happens before the first stage and after the last.
"""

from pipeline.command import take_over_luigi
from tasks.results.export import Export
from tasks.results.grid import Grid
from tasks.results.scene_report import SceneReport
from tasks.results.trade_off import TradeOff
from tasks.results.trajectory import StylizedTrajectory
from tasks.results.viewer import Viewer
from tasks.stages.content import ContentImages
from tasks.stages.field import PriorRenders, RadianceField, TrajectoryFrames
from tasks.stages.metrics import (
    ConsistencyMetrics,
    QualityMetrics,
    StyleMetrics,
    StylizationMetrics,
)
from tasks.stages.scene import CameraPoses, SceneCapture, SceneModel
from tasks.stages.style import StyleImage, StyleNetwork
from tasks.stages.stylization import StylizedField, StylizedFrames, StylizedPriors
from tasks.stages.weights import PerceptualWeights, TransferWeights

__all__ = [
    "CameraPoses",
    "ConsistencyMetrics",
    "ContentImages",
    "Export",
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
    "Viewer",
]

take_over_luigi(f"{__name__}.command_line")  # of `luigi --module tasks ...`; others go on
