"""The records of everything that artifacts were made from."""

from collections.abc import Iterable, Mapping

from pipeline.record import ActionRecord


def ancestors(addresses: Iterable[str], known: Mapping[str, ActionRecord]) -> list[ActionRecord]:
    """Returns the records of addresses and of everything that they were made from, each once.

    Args:
        addresses: Keys or digests.
        known: The records by their addresses. A record that is not among them is left out.
    """
    found: dict[str, ActionRecord] = {}
    pending = list(addresses)
    while pending:
        record = known.get(pending.pop())
        if record and record.action.key not in found:
            found[record.action.key] = record
            pending += record.action.inputs.values()
    return list(found.values())
