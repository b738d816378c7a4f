"""The committed snapshot of all families' code, and the declarations of equal results."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pipeline.code.closure import code_closure, code_digest
from pipeline.errors import StoreError
from pipeline.settings import configured_path


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The code of families of tasks, for review and for adoption.

    Attributes:
        families: The code of each family: a digest, or its pinned revision.
        code: The shortened digest of each function, class and constant they depend on.
        adopted: Declarations, oldest first, that the code `to` of a `family` gives the results of
            `from`, each with its `reason` and `date`.
    """

    families: dict[str, str] = field(default_factory=dict)
    code: dict[str, str] = field(default_factory=dict)
    adopted: tuple[Mapping[str, str], ...] = ()

    @classmethod
    def read(cls) -> "Snapshot":
        """Reads the file that `[store] identity` names; empty if there is no such file.

        Raises:
            StoreError: The file is not a snapshot.
        """
        path = identity_file()
        try:
            return cls(**json.loads(path.read_bytes())) if path.exists() else cls()
        except (TypeError, ValueError) as error:
            raise StoreError(f"{path} is not a snapshot ({error}). Restore it from git.") from error

    def original(self, family: str, code: str) -> str:
        """Returns the oldest code of the family that was declared equal to `code`."""
        earlier = {a["to"]: a["from"] for a in self.adopted if a["family"] == family}
        while code in earlier:
            code = earlier.pop(code)
        return code


def present_code(task: type, revision: str | None) -> str:
    """Returns the digest of the present code of a task, or its pinned revision."""
    return f"revision {revision}" if revision else code_digest(code_closure(task))


def code_in_key(family: str, code: str) -> str:
    """Returns the oldest code of the family that was declared equal to `code` by now."""
    return Snapshot.read().original(family, code)


def identity_file() -> Path:
    """Returns where the snapshot is: [store] identity, or tasks/identity.json beside the code."""
    return configured_path("store", "identity")
