"""The pairs of frames that a command measures, which a training leaves out.

`ConsistencyMetrics` needs the network of that training. So its settings are read here by its name:
those of the quality and of `--tuning`, which every stage has. A build runs in another process,
which does not see `--ConsistencyMetrics-settings`.
"""

import json
from collections.abc import Mapping
from typing import Any

from luigi.freezing import recursively_unfreeze

from styletrf.configuration import configured
from styletrf.errors import InputError
from styletrf.evaluation.consistency.pair_plan import PairPlan
from tasks.stages.stage import ConfigurableStage, PresetStage

_MEASURING = "ConsistencyMetrics"
_DECIDE_PAIRS = {"deltas", "depth_deltas", "pairs"}


def pair_settings(stage: PresetStage) -> dict[str, Any]:
    """Returns the settings of a command that choose the pairs of frames it measures."""
    return _of_pairs(stage.tuned(_MEASURING, stage.quality))


def require_tuned_pairs(stage: PresetStage) -> None:
    """Rejects pairs that a command measures and the build of a stage would not know.

    Raises:
        InputError: `--ConsistencyMetrics-settings` chooses other pairs than `--tuning`, or one of
            their values is invalid.
    """
    own = ConfigurableStage.settings.task_value(_MEASURING, "settings")
    measured = _of_pairs(stage.tuned(_MEASURING, stage.quality, own))
    if configured(PairPlan, measured) != configured(PairPlan, pair_settings(stage)):
        tuning = recursively_unfreeze(stage.tuning)  # type: ignore[no-untyped-call]
        tuning[_MEASURING] = tuning.get(_MEASURING, {}) | measured
        raise InputError(
            f"--{_MEASURING}-settings",
            f"chooses pairs that {stage.task_family} cannot leave out of its training",
            f"Give instead --tuning '{json.dumps(tuning)}'",
        )


def _of_pairs(settings: Mapping[str, Any]) -> dict[str, Any]:
    return {name: settings[name] for name in sorted(_DECIDE_PAIRS & set(settings))}
