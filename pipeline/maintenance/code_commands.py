"""The commands of `python -m pipeline` about code: why a task would run, and what changed."""

import dataclasses
import importlib
from argparse import Namespace

from luigi.cmdline_parser import CmdlineParser

from pipeline.code.adoption import adopting, packages, snapshot_of, write_snapshot
from pipeline.code.snapshot import Snapshot, identity_file
from pipeline.errors import StoreError
from pipeline.maintenance.commands import Answer
from pipeline.maintenance.why import explain
from pipeline.store import Store
from pipeline.task import StoredTask


def why(store: Store, options: Namespace) -> Answer:
    """Why tasks would run: what differs from the nearest artifact, first things first."""
    _import(options.module)
    words = ["--module", options.module, *options.task]
    with CmdlineParser.global_instance(words) as parser:
        return 0, list(explain(parser.get_task_obj(), store))


def snapshot(_store: object, options: Namespace) -> Answer:
    """Write down the code of all families, for review; tells which changed."""
    before, now = _then_and_now(options.module)
    write_snapshot(dataclasses.replace(now, adopted=before.adopted))
    pairs = {f: (before.families.get(f), code) for f, code in now.families.items()}
    return 0, [{"family": f, "then": a, "now": b} for f, (a, b) in pairs.items() if a != b]


def adopt(_store: object, options: Namespace) -> Answer:
    """Declare that edits of the code changed no result, so that nothing is built again."""
    before, now = _then_and_now(options.module)
    after = dataclasses.replace(before, code=now.code)
    for family in options.family:
        if family not in now.families:
            known = ", ".join(sorted(now.families))
            raise StoreError(f"{options.module} has no stage {family}. It has {known}.")
        after = adopting(after, family, now.families[family], options.reason)
    write_snapshot(after)
    return 0, [dict(entry) for entry in after.adopted[len(before.adopted) :]]


def families(module: str) -> list[type[StoredTask]]:
    """The stored tasks that a package defines and that build something."""
    _import(module)
    kinds = StoredTask.__subclasses__()
    for kind in kinds:
        kinds += [each for each in kind.__subclasses__() if each not in kinds]
    ours = [kind for kind in kinds if kind.__module__.split(".")[0] == module.split(".")[0]]
    return [kind for kind in ours if kind.build is not StoredTask.build]


def _then_and_now(module: str) -> tuple[Snapshot, Snapshot]:
    """The snapshot in the file, and that of the package as it is now."""
    then, now = Snapshot.read(), snapshot_of(families(module))
    others = packages(then) - {module.split(".")[0]}
    if others:
        raise StoreError(
            f"{identity_file()} is the snapshot of {', '.join(sorted(others))}."
            f" Give {module} a file of its own: [store] identity in `luigi.cfg`."
        )
    return then, now


def _import(module: str) -> None:
    try:
        importlib.import_module(module)
    except ImportError as error:
        raise StoreError(f"--module {module} cannot be imported: {error}") from error
