"""The commands of `python -m pipeline` that check, repair, clean and share a store."""

import sys
from argparse import Namespace
from collections.abc import Callable

from pipeline.console.display import is_interactive
from pipeline.console.progress import ProgressBar
from pipeline.errors import StoreError
from pipeline.maintenance import roots
from pipeline.maintenance.ancestors import ancestors
from pipeline.maintenance.commands import CommandResult, Rows, find_all, row_of, totals
from pipeline.maintenance.garbage_collection import collect
from pipeline.maintenance.verify import problems, repair, unreferenced_objects
from pipeline.record import ActionRecord
from pipeline.shared_store import sync
from pipeline.shared_store.settings import current_remote
from pipeline.store import Store


def verify(store: Store, options: Namespace) -> CommandResult:
    """Finds damage, with status 1 if some is left. Garbage comes last."""
    rows: Rows = []
    for problem in problems(store, deep=options.deep):
        label = problem.record.provenance["label"] if problem.record else None
        done = repair(store, problem) if options.repair else None
        rows.append({"found": problem.kind, "what": label, "path": str(problem.path), "done": done})
    garbage: Rows = [
        {"found": "garbage, for gc", "path": str(path)} for path in unreferenced_objects(store)
    ]
    return int(bool(rows) and not options.repair), rows + garbage


def push(store: Store, options: Namespace) -> CommandResult:
    """Uploads what the shared store lacks, with status 1 if something failed."""
    chosen = [r for a in options.address for r in find_all(store.records(), a)]
    return _transfer(
        chosen or list(store.records()), lambda r: sync.push(store, r, current_remote())
    )


def pull(store: Store, options: Namespace) -> CommandResult:
    """Fetches artifacts from the shared store, with status 1 if something failed."""
    remote = current_remote()
    if not options.address and not options.grid:
        raise StoreError("pull needs an artifact or a grid: a KEY or DIGEST, or --grid NAME")
    if options.grid:
        found = sync.listed_records(remote, options.grid)
    else:
        found = sync.shared_records(remote)
    chosen = [r for a in options.address for r in find_all(found, a)]
    chosen = chosen or (found if options.grid else [])
    if options.closure:
        known = {n: r for r in found for n in (r.output.digest, r.action.key)}
        chosen = ancestors([r.action.key for r in chosen], known)
    return _transfer(
        chosen, lambda r: sync.pull(store, sync.import_record(store, r, remote, store.find), remote)
    )


def _transfer(chosen: list[ActionRecord], act: Callable[[ActionRecord], str]) -> CommandResult:
    bar = ProgressBar("artifacts", sys.stderr, interactive=is_interactive())
    rows: Rows = []
    for i, record in enumerate(chosen):
        bar(i, len(chosen))
        rows.append({**row_of(record), "done": act(record)})
    bar.close()
    rows = [row for row in rows if row["done"] not in ("is here", "is there")]
    return int(any(row["done"] not in ("fetched", "pushed") for row in rows)), rows


def gc(store: Store, options: Namespace) -> CommandResult:
    """Lists the garbage, then what stays, and why. It deletes the garbage only with --delete."""
    decisions = collect(
        store, keep_last=options.keep_last, grace_hours=options.grace, delete=options.delete
    )
    return 0, totals(
        ({"fate": "goes" if v.delete else "stays", "what": v.what, "why": v.why}, v.size)
        for v in sorted(decisions, key=lambda decision: not decision.delete)
    )


def pin(store: Store, options: Namespace) -> CommandResult:
    """Keeps an artifact until `unpin`. Without an artifact, it lists the pins."""
    if options.address:
        key = roots.require_single(find_all(store.records(), options.address)).action.key
        roots.pin(store, key, options.name or key[:12])
    return 0, [{"name": name, "key": key} for name, key in roots.pins(store).items()]


def unpin(store: Store, options: Namespace) -> CommandResult:
    """Lets gc collect what a pin keeps, or what a folder shows."""
    roots.unpin(store, options.name)
    return 0, [{"name": name, "key": key} for name, key in roots.pins(store).items()]
