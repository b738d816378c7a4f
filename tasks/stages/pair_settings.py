"""The pairs of frames that a command measures, which a training leaves out.

`ConsistencyMetrics` needs the network of that training. So its settings are read here by its name.
"""

from typing import Any

from tasks.stages.stage import ConfigurableStage, PresetStage

_MEASURING = "ConsistencyMetrics"
_DECIDE_PAIRS = {"deltas", "depth_deltas", "pairs"}


def pair_settings(stage: PresetStage) -> dict[str, Any]:
    """Returns the settings of a command that choose the pairs of frames it measures."""
    own = ConfigurableStage.settings.task_value(_MEASURING, "settings")
    values = stage.tuned(_MEASURING, stage.quality, own)
    return {name: values[name] for name in sorted(_DECIDE_PAIRS & set(values))}
