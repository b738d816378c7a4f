"""What is known of artifacts here: their records, and whether their objects can be had."""

from dataclasses import dataclass

from pipeline.publication import protect
from pipeline.record import ActionRecord
from pipeline.store import Store


@dataclass(frozen=True)
class Artifacts:
    """The artifacts of one store; a subclass may know further places to get them from.

    Attributes:
        store: The store of this machine.
    """

    store: Store

    def lookup(self, key: str) -> ActionRecord | None:
        """The record of the key; what it names stays while this process lives."""
        return self.store.lease_record(key)

    def is_available(self, record: ActionRecord) -> bool:
        """Whether the record's object can be had; quick."""
        return self.store.intact(record)

    def fetch(self, record: ActionRecord) -> bool:
        """Has the record's object in the store; returns whether it is there now.

        Raises:
            OSError: The store's disk fails or is full.
        """
        return self.store.intact(record)

    def upload(self, record: ActionRecord) -> None:
        """Gives the artifact to other machines, if it is shared with any."""

    def restore(self, record: ActionRecord, damage: str | None) -> bool:
        """Has the object in the store as it was made, or else sets it aside.

        Args:
            record: Of the object.
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
