"""The action record: which object a task made, from what, and how."""

import dataclasses
import functools
import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version

from pipeline.canonical import Json, canonical_json
from pipeline.digest import Tree, typed_digest

FORMAT = 2
"""The format of the JSON below. A record of any other format counts as absent."""

_PROVENANCE_FIELDS = {"label", "task", "started", "seconds", "log"}


@dataclass(frozen=True)
class Action:
    """Everything that decides an artifact; two equal actions are one artifact.

    Attributes:
        family: The task's name.
        code: Digest of the code the task depends on, or the revision it pins.
        parameters: The identity parameters in canonical form.
        inputs: Digest of each upstream artifact, by the name the task gives it.
        sources: Digest of each thing read from outside the store, by name.
        tools: Version of each distribution the task declares.
        salt: A word. A changed word invalidates all earlier artifacts.
    """

    family: str
    code: str
    parameters: Json
    inputs: Mapping[str, str]
    sources: Mapping[str, str]
    tools: Mapping[str, str]
    salt: str = ""

    @functools.cached_property
    def key(self) -> str:
        """Returns the action's key: 64 hexadecimal digits over all its fields."""
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return typed_digest("pipeline-action-v1", canonical_json(fields))


@dataclass(frozen=True, slots=True)
class ActionRecord:
    """The statement "this action made this object": the only commit point of the store.

    Attributes:
        action: Everything that decides the artifact.
        output: The content of the artifact.
        provenance: How it was made, which no key covers: `task` and `label` (as shown), `host`,
            `started` (UTC), `seconds`, `log` (relative to the store), and for builds
            `peak_memory_bytes`, `earlier_seconds` (the part of `seconds` of killed attempts),
            `cpu_seconds`, and `other_cpu_seconds` (of all other processes in the same time).
    """

    action: Action
    output: Tree
    provenance: Mapping[str, Json]

    def to_json(self) -> bytes:
        """Returns the record as indented JSON with sorted keys and a checksum."""
        fields = {"format": FORMAT, "key": self.action.key, **dataclasses.asdict(self)}
        fields["check"] = _check(fields)
        return json.dumps(fields, sort_keys=True, indent=1).encode()

    @classmethod
    def from_json(cls, text: bytes) -> "ActionRecord":
        """Reads the record that `to_json` wrote.

        Raises:
            ValueError: The text is anything else: truncated, altered or of another format.
        """
        try:
            fields = json.loads(text)
            record = cls(
                Action(**fields["action"]), Tree(**fields["output"]), dict(fields["provenance"])
            )
            check = fields.pop("check")
            found = (fields["format"], fields["key"], check)
            is_whole = found == (FORMAT, record.action.key, _check(fields))
            if not (is_whole and record.provenance.keys() >= _PROVENANCE_FIELDS):
                raise ValueError("it has another format or was altered")
        except (KeyError, TypeError, AttributeError, RecursionError) as error:
            raise ValueError(f"not an action record: {error!r}") from error
        return record


def _check(fields: Mapping[str, Json]) -> str:
    return typed_digest("pipeline-record-v2", canonical_json(fields))


@functools.cache
def public_version(distribution: str) -> str:
    """Returns 2.13.0 for 2.13.0+cpu: the local suffix does not change the results."""
    return version(distribution).partition("+")[0]
