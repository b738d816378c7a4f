"""The committed snapshot of all families' code, and what was declared to have changed nothing."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from pipeline.code_identity import closure, code_digest
from pipeline.errors import StoreError
from pipeline.settings import identity_file

if TYPE_CHECKING:
    from pipeline.task import StoredTask


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

    def write(self) -> None:
        """Replace the file that `read` reads."""
        text = json.dumps(asdict(self), sort_keys=True, indent=1)
        identity_file().write_text(f"{text}\n")

    @classmethod
    def of(cls, tasks: Iterable[type["StoredTask"]]) -> "Snapshot":
        """The code of some tasks as it is now."""
        now = cls()
        for task in tasks:
            members = {} if task.revision else closure(task)
            pinned = task.revision and f"revision {task.revision}"
            now.families[str(task.task_family)] = pinned or code_digest(members)
            now.code.update({name: digest[:16] for name, digest in members.items()})
        return now

    def packages(self) -> set[str]:
        """The packages that define its families."""
        classes = (name for name in self.code if name.endswith(".__mro__"))
        return {name.partition(":")[0].split(".")[0] for name in classes}

    def original(self, family: str, code: str) -> str:
        """The oldest code of the family that `code` was declared to mean the same as."""
        earlier = {a["to"]: a["from"] for a in self.adopted if a["family"] == family}
        while code in earlier:
            code = earlier.pop(code)
        return code

    def adopting(self, family: str, code: str, reason: str) -> "Snapshot":
        """This snapshot after the declaration that `code` is to the family what it had before.

        Raises:
            StoreError: When the family's code is the same or was not known, or no reason is given.
        """
        if not reason.strip():
            raise StoreError("say with --reason why the results are the same")
        if family not in self.families:
            raise StoreError(f"{family} is in no snapshot yet: `snapshot` adds it.")
        known = self.families[family]
        if known == code:
            raise StoreError(
                f"{family}: its code is that of the snapshot; nothing is to be adopted."
            )
        words = {"family": family, "from": known, "to": code, "reason": reason}
        entry = {**words, "date": datetime.now(UTC).date().isoformat()}
        is_new = self.original(family, code) != self.original(family, known)
        families = {**self.families, family: code}
        return Snapshot(families, self.code, (*self.adopted, *[entry] * is_new))


def code_in_key(task: type["StoredTask"]) -> str:
    """The code of a task as it is now, or the oldest that it was declared to mean the same as."""
    ((family, code),) = Snapshot.of([task]).families.items()
    return Snapshot.read().original(family, code)
