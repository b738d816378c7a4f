"""The committed snapshot of all families' code, and what was declared to have changed nothing."""

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
        families: The code of each family: a digest, or the revision it pins.
        code: The digest, shortened, of each function, class and constant they depend on.
        adopted: Declarations, oldest first, that the code `to` of a `family` means what `from`
            meant, each with its `reason` and `date`.
    """

    families: dict[str, str] = field(default_factory=dict)
    code: dict[str, str] = field(default_factory=dict)
    adopted: tuple[Mapping[str, str], ...] = ()

    @classmethod
    def read(cls) -> "Snapshot":
        """The one in the file that `[store] identity` names; an empty one where there is none.

        Raises:
            StoreError: When the file holds something else.
        """
        path = identity_file()
        try:
            return cls(**json.loads(path.read_bytes())) if path.exists() else cls()
        except (TypeError, ValueError) as error:
            raise StoreError(f"{path} holds no snapshot ({error}). Take it from git.") from error

    def original(self, family: str, code: str) -> str:
        """The oldest code of the family that `code` was declared to mean the same as."""
        earlier = {a["to"]: a["from"] for a in self.adopted if a["family"] == family}
        while code in earlier:
            code = earlier.pop(code)
        return code


def code_in_key(task: type, family: str, revision: str | None) -> str:
    """The code of a task as it is now, or the oldest that it was declared to mean the same as."""
    code = f"revision {revision}" if revision else code_digest(code_closure(task))
    return Snapshot.read().original(family, code)


def identity_file() -> Path:
    """The snapshot of the code: [store] identity of `luigi.cfg`, or ./tasks/identity.json."""
    return configured_path("store", "identity")
