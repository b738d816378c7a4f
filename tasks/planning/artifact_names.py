"""Names for the artifacts that stages will have, before the stages have keys."""

import hashlib
import json
from typing import Any, final

from pipeline.canonical import canonical_json
from pipeline.task import StoredTask

_NAMES = ("scene", "style", "content", "perceptual", "transfer", "network", "path", "shard")


@final
class ArtifactNames:
    """Names stages; each is named once."""

    def __init__(self) -> None:
        self._names: dict[str, str] = {}

    def of(self, stage: StoredTask) -> str:
        """Returns the same name for stages that will have the same artifact."""
        if stage.task_id not in self._names:
            parts = {
                "family": stage.task_family,
                "identity": stage.identity_parameters(),
                "names": {n: stage.param_kwargs[n] for n in _NAMES if n in stage.param_kwargs},
                "inputs": {n: self.of(task) for n, task in stage.requires().items()},
            }
            self._names[stage.task_id] = hashlib.sha256(_text(parts)).hexdigest()
        return self._names[stage.task_id]


def _text(parts: dict[str, Any]) -> bytes:
    """Returns the canonical text of the parts, or one of settings that are refused later."""
    try:
        return canonical_json(parts)
    except (TypeError, ValueError):
        return json.dumps(parts, sort_keys=True, default=str).encode()
