"""The commands of `python -m pipeline` that keep a store whole and small, and share it."""

import sys
from argparse import Namespace
from collections.abc import Callable

from pipeline.console.display import is_interactive
from pipeline.console.progress import ProgressBar
from pipeline.errors import StoreError
from pipeline.maintenance import roots
from pipeline.maintenance.commands import Answer, Rows, find_all, row_of, totals
from pipeline.maintenance.garbage_collection import collect
from pipeline.maintenance.verify import problems, repair, unreferenced_objects
from pipeline.record import ActionRecord, ancestors
from pipeline.shared_store import sync
from pipeline.shared_store.settings import current_remote
from pipeline.store import Store


def verify(store: Store, options: Namespace) -> Answer:
    """Look for damage; status 1 where some is left. What gc would take comes last."""
    rows: Rows = []
    for problem in problems(store, deep=options.deep):
        label = problem.record.provenance["label"] if problem.record else None
        done = repair(store, problem) if options.repair else None
        rows.append({"found": problem.kind, "what": label, "path": str(problem.path), "done": done})
    garbage: Rows = [
        {"found": "garbage, for gc", "path": str(path)} for path in unreferenced_objects(store)
    ]
    return int(bool(rows) and not options.repair), rows + garbage


def push(store: Store, options: Namespace) -> Answer:
    """Upload what the shared store lacks; status 1 where something could not be."""
    chosen = [r for a in options.address for r in find_all(store.records(), a)]
    return _transfer(
        chosen or list(store.records()), lambda r: sync.push(store, r, current_remote())
    )


def pull(store: Store, options: Namespace) -> Answer:
    """Fetch from the shared store; status 1 where something could not be."""
    remote = current_remote()
    if not options.address and not options.night:
        raise StoreError("pull takes what is named: a KEY or DIGEST, or --night NAME")
    if options.night:
        found = sync.listed_records(remote, options.night)
    else:
        found = sync.shared_records(remote)
    chosen = [r for a in options.address for r in find_all(found, a)]
    chosen = chosen or (found if options.night else [])
    if options.closure:
        known = {n: r for r in found for n in (r.output.digest, r.action.key)}
        chosen = ancestors([r.action.key for r in chosen], known)
    return _transfer(
        chosen, lambda r: sync.pull(store, sync.import_record(store, r, remote), remote)
    )


def _transfer(chosen: list[ActionRecord], act: Callable[[ActionRecord], str]) -> Answer:
    bar = ProgressBar("artifacts", sys.stderr, interactive=is_interactive())
    rows: Rows = []
    for i, record in enumerate(chosen):
        bar(i, len(chosen))
        rows.append({**row_of(record), "done": act(record)})
    bar.close()
    rows = [row for row in rows if row["done"] not in ("is here", "is there")]
    return int(any(row["done"] not in ("fetched", "pushed") for row in rows)), rows


def gc(store: Store, options: Namespace) -> Answer:
    """What nothing holds any more, then what stays, and why; deletes only with --delete."""
    decisions = collect(
        store, keep_last=options.keep_last, grace_hours=options.grace, delete=options.delete
    )
    return 0, totals(
        ({"fate": "goes" if v.delete else "stays", "what": v.what, "why": v.why}, v.size)
        for v in sorted(decisions, key=lambda decision: not decision.delete)
    )


def pin(store: Store, options: Namespace) -> Answer:
    """Keep an artifact whatever gc thinks; without one, list what is pinned."""
    if options.address:
        key = roots.require_single(find_all(store.records(), options.address)).action.key
        roots.pin(store, key, options.name or key[:12])
    return 0, [{"name": name, "key": key} for name, key in roots.pins(store).items()]


def unpin(store: Store, options: Namespace) -> Answer:
    """Leave to gc again what a pin keeps, or what a folder shows."""
    roots.unpin(store, options.name)
    return 0, [{"name": name, "key": key} for name, key in roots.pins(store).items()]
