"""`python -m pipeline`: what the store holds."""

import argparse
import sys

from pipeline.errors import StoreError
from pipeline.record import ActionRecord
from pipeline.settings import current_store
from pipeline.store import Store
from pipeline.verify import problems, records


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns its exit status."""
    parser = argparse.ArgumentParser(prog="python -m pipeline", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    listing = commands.add_parser("ls", help="one line an artifact")
    listing.add_argument("family", nargs="?", help="only of this task")
    showing = commands.add_parser("show", help="all that is known of an artifact")
    showing.add_argument("address", help="first digits of a key or of a digest")
    verifying = commands.add_parser("verify", help="look for damage; status 1 where there is some")
    verifying.add_argument("--deep", action="store_true", help="read every byte")
    options = parser.parse_args(arguments)
    try:
        store = current_store()
        if options.command == "ls":
            return _list(store, options.family)
        return (
            _show(store, options.address)
            if options.command == "show"
            else _verify(store, deep=options.deep)
        )
    except StoreError as error:
        sys.stderr.write(f"{error}\n")
        return 2


def _list(store: Store, family: str | None) -> int:
    chosen = [record for record in records(store) if family in (None, record.action.family)]
    for record in sorted(chosen, key=lambda record: str(record.provenance["started"])):
        sys.stdout.write(_line(record) + "\n")
    return 0


def _show(store: Store, address: str) -> int:
    found = [
        record
        for record in records(store)
        if record.action.key.startswith(address) or record.output.digest.startswith(address)
    ]
    for record in found:
        path = store.object(record.output.digest)
        sys.stdout.write(f"{record.to_json().decode()}\n{path}\n")
        for name, digest in record.action.inputs.items():
            makers = [other for other in records(store) if other.output.digest == digest]
            sys.stdout.write("".join(f"  {name}: {_line(maker)}\n" for maker in makers))
    if not found:
        sys.stderr.write(f"nothing in {store.root} begins with {address}\n")
    return 0 if found else 1


def _verify(store: Store, *, deep: bool) -> int:
    found = list(problems(store, deep=deep))
    sys.stdout.write("".join(f"{problem}\n" for problem in found) or "whole\n")
    return 1 if found else 0


def _line(record: ActionRecord) -> str:
    seen, megabytes = record.provenance, record.output.size / 1e6
    return (
        f"{record.action.key[:12]} {seen['started']}  {seen['seconds']:8.1f} s  {megabytes:8.1f} MB"
        f"  {seen['label']}"
    )


if __name__ == "__main__":
    sys.exit(main())
