"""The commands of `python -m pipeline`: each turns a store and its options into rows."""

import re
import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeAlias

from pipeline import roots, sharing
from pipeline.canonical import Json
from pipeline.collection import closure, collect
from pipeline.errors import StoreError
from pipeline.execution import is_interactive
from pipeline.progress import ProgressBar
from pipeline.record import ActionRecord
from pipeline.settings import current_remote
from pipeline.store import Store
from pipeline.verify import problems, records, repair, strays

Rows: TypeAlias = list[dict[str, Json]]
Answer: TypeAlias = tuple[int, Rows]
"""An exit status, and what to print as a table or as JSON."""


def ls(store: Store, options: Namespace) -> Answer:
    """One row an artifact, or an attempt that left none; oldest first."""
    if options.failed:
        return 0, _failures(store, options.family or "*")
    chosen = [r for r in records(store) if options.family in (None, r.action.family)]
    return 0, [_row(r) for r in sorted(chosen, key=lambda r: str(r.provenance["started"]))]


def show(store: Store, options: Namespace) -> Answer:
    """A row a fact: all that is known of the artifacts whose key or digest begins so."""
    rows: Rows = []
    for record in find_all(records(store), options.address):
        facts: dict[str, Json] = {
            "key": record.action.key,
            "object": str(store.object(record.output.digest)),
            **{f"output.{name}": getattr(record.output, name) for name in ("size", "files")},
            **record.provenance,
            "log": str(store.root / str(record.provenance["log"])),
            "code": record.action.code,
            "parameters": record.action.parameters,
            **{f"tool {name}": word for name, word in record.action.tools.items()},
            **{f"source {name}": word for name, word in record.action.sources.items()},
        }
        for name, digest in record.action.inputs.items():
            makers = [r for r in records(store) if r.output.digest == digest]
            labels = ", ".join(f"{m.provenance['label']} ({m.action.key[:12]})" for m in makers)
            facts[f"input {name}"] = f"{digest[:12]} by {labels or 'nothing in this store'}"
        rows += [{"fact": name, "value": value} for name, value in facts.items()]
    return 0, rows


def verify(store: Store, options: Namespace) -> Answer:
    """A row a problem and what was done, if asked; status 1 where one is left. Then, garbage."""
    rows: Rows = []
    for problem in problems(store, deep=options.deep):
        label = problem.record.provenance["label"] if problem.record else None
        done = repair(store, problem) if options.repair else None
        rows.append({"found": problem.kind, "what": label, "path": str(problem.path), "done": done})
    garbage: Rows = [{"found": "garbage, for gc", "path": str(path)} for path in strays(store)]
    return int(bool(rows) and not options.repair), rows + garbage


def push(store: Store, options: Namespace) -> Answer:
    """A row an artifact uploaded to the shared store; status 1 where one could not be."""
    chosen = [r for a in options.address for r in find_all(records(store), a)]
    return _transfer(
        chosen or list(records(store)), lambda r: sharing.push(store, r, current_remote())
    )


def pull(store: Store, options: Namespace) -> Answer:
    """A row an artifact fetched from the shared store; status 1 where one could not be."""
    remote = current_remote()
    found = sharing.shared_records(remote)
    chosen = [r for a in options.address for r in find_all(found, a)]
    if options.closure:
        known = {n: r for r in found for n in (r.output.digest, r.action.key)}
        chosen = closure([r.action.key for r in chosen], known)
    return _transfer(chosen, lambda r: sharing.pull(store, sharing.adopt(store, r), remote))


def _transfer(chosen: list[ActionRecord], act: Callable[[ActionRecord], str]) -> Answer:
    bar = ProgressBar("artifacts", sys.stderr, interactive=is_interactive())
    rows: Rows = []
    for i, record in enumerate(chosen):
        bar(i, len(chosen))
        rows.append({**_row(record), "done": act(record)})
    bar.close()
    rows = [row for row in rows if row["done"] not in ("is here", "is there")]
    return int(any(row["done"] not in ("fetched", "pushed") for row in rows)), rows


def gc(store: Store, options: Namespace) -> Answer:
    """A row for what goes (unless told to delete: would go) and why; then for what stays."""
    verdicts = collect(
        store, keep_last=options.keep_last, grace_hours=options.grace, delete=options.delete
    )
    return 0, _totals(
        ({"fate": "goes" if v.goes else "stays", "what": v.what, "why": v.why}, v.size)
        for v in sorted(verdicts, key=lambda verdict: not verdict.goes)
    )


def du(store: Store, _options: Namespace) -> Answer:
    """A row a family, then one a scene; what several share is counted once, for all of them."""
    objects: dict[str, list[ActionRecord]] = {}
    for record in records(store):
        if store.object(record.output.digest).is_dir():
            objects.setdefault(record.output.digest, []).append(record)
    return 0, _totals(
        ({of: ", ".join(sorted({name(record) for record in makers}))}, makers[0].output.size)
        for of, name in (("family", lambda record: record.action.family), ("scene", _scene))
        for makers in objects.values()
    )


def pin(store: Store, options: Namespace) -> Answer:
    """Keep an artifact, if one is given; a row a pin."""
    if options.address:
        key = roots.only(find_all(records(store), options.address)).action.key
        roots.pin(store, key, options.name or key[:12])
    return 0, [{"name": name, "key": key} for name, key in roots.pins(store).items()]


def unpin(store: Store, options: Namespace) -> Answer:
    """Give up a pin; a row for each that remains."""
    roots.unpin(store, options.name)
    return 0, [{"name": name, "key": key} for name, key in roots.pins(store).items()]


def find_all(among: Iterable[ActionRecord], address: str) -> list[ActionRecord]:
    """Those records whose key or digest begins with `address`.

    Raises:
        StoreError: When there is none.
    """
    found = [
        record
        for record in among
        if any(name.startswith(address) for name in (record.action.key, record.output.digest))
    ]
    if not found:
        raise StoreError(f"no key or digest begins with {address}")
    return found


def _totals(parts: Iterable[tuple[Mapping[str, str], int]]) -> Rows:
    """A row for each different mapping: how many there were, and their bytes."""
    found: dict[tuple[tuple[str, str], ...], list[int]] = {}
    for names, size in parts:
        found.setdefault(tuple(names.items()), []).append(size)
    return [
        {**dict(names), "count": len(sizes), "size_bytes": sum(sizes)}
        for names, sizes in found.items()
    ]


def _scene(record: ActionRecord) -> str:
    """The scene that the task was asked for; none for what scenes share, such as a style."""
    asked = re.search(r"\bscene=([^,)]*)", str(record.provenance["task"]))
    return asked[1] if asked else "(none)"


def _failures(store: Store, family: str) -> Rows:
    """A row a log that no record names, with its last line: the attempt failed, or is under way."""
    named = {str(record.provenance["log"]) for record in records(store)}
    logs = sorted(
        (store.root / "logs").glob(f"{family}/*.log"), key=lambda log: log.stat().st_mtime
    )
    return [
        {"log": str(log), "end": log.read_text(errors="replace").strip().rpartition("\n")[2]}
        for log in logs
        if log.relative_to(store.root).as_posix() not in named
    ]


def _row(record: ActionRecord) -> dict[str, Json]:
    seen = record.provenance
    return {
        "key": record.action.key,
        "started": seen["started"],
        "seconds": seen["seconds"],
        "size_bytes": record.output.size,
        "label": seen["label"],
    }


Parameters: TypeAlias = Mapping[str, Mapping[str, Any]]
Command: TypeAlias = tuple[Callable[[Store, Namespace], Answer], str, Parameters]
COMMANDS: Mapping[str, Command] = {
    "ls": (
        ls,
        "one line an artifact",
        {
            "family": {"nargs": "?", "help": "only of this task"},
            "--failed": {"action": "store_true", "help": "logs of attempts that left none"},
        },
    ),
    "show": (
        show,
        "all that is known of an artifact",
        {"address": {"help": "first digits of a key or of a digest"}},
    ),
    "verify": (
        verify,
        "look for damage; status 1 where there is some",
        {
            "--deep": {"action": "store_true", "help": "read every byte"},
            "--repair": {"action": "store_true", "help": "from the shared store, or set aside"},
        },
    ),
    "push": (
        push,
        "upload what the shared store lacks",
        {"address": {"nargs": "*", "help": "first digits of keys or digests; none: all"}},
    ),
    "pull": (
        pull,
        "fetch from the shared store",
        {
            "address": {"nargs": "+", "help": "first digits of keys or of digests"},
            "--closure": {"action": "store_true", "help": "with all that they were made from"},
        },
    ),
    "gc": (
        gc,
        "what nothing holds any more; deletes it only if told so",
        {
            "--delete": {"action": "store_true", "help": "do it"},
            "--keep-last": {"type": int, "default": 3, "metavar": "N", "help": "runs (3)"},
            "--grace": {"type": float, "default": 24.0, "metavar": "HOURS", "help": "(24)"},
        },
    ),
    "pin": (
        pin,
        "keep an artifact whatever gc thinks; without one, list what is pinned",
        {
            "address": {"nargs": "?", "help": "first digits of a key or of a digest"},
            "--name": {"help": "what to call it"},
        },
    ),
    "unpin": (unpin, "leave it to gc again", {"name": {"help": "as `pin` lists it"}}),
    "du": (du, "bytes by task and by scene", {}),
}
"""By name: what to run, its help, and its arguments as `argparse` takes them."""
