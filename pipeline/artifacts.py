"""Artifacts as tasks see them: their records, and whether their objects are available."""

from dataclasses import dataclass

from pipeline.publication import protect
from pipeline.record import ActionRecord
from pipeline.store import Store


@dataclass(frozen=True)
class Artifacts:
    """The artifacts of one store. A subclass may search other stores as well.

    Attributes:
        store: The store of this machine.
    """

    store: Store

    def lookup(self, key: str) -> ActionRecord | None:
        """Returns the record of the key, and keeps its artifacts while this process lives."""
        return self.store.lease_record(key)

    def is_available(self, record: ActionRecord) -> bool:
        """Whether the record's object is available. The check is quick."""
        return self.store.intact(record)

    def fetch(self, record: ActionRecord) -> bool:
        """Fetches the record's object into the store if needed; returns whether it is there.

        Raises:
            OSError: The store's disk fails or is full.
        """
        return self.store.intact(record)

    def upload(self, record: ActionRecord) -> None:
        """Uploads the artifact for other machines, if there is a shared store."""

    def restore(self, record: ActionRecord, damage: str | None) -> bool:
        """Restores the object in the store to its original state, or sets it aside.

        Args:
            record: The record of the object.
            damage: What `Store.find_damage` found.

        Returns:
            Whether the object is intact now.
        """
        path = self.store.object(record.output.digest)
        if damage == "writable":
            protect(path)
        elif damage == "altered":
            self.store.quarantine(path)
        return self.fetch(record)
