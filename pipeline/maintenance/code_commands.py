"""The commands of `python -m pipeline` about code: why a task would run, and which code changed."""

import dataclasses
import importlib
from argparse import Namespace

from luigi.cmdline_parser import CmdlineParser
from luigi.parameter import ParameterException
from luigi.task_register import TaskClassException

from pipeline.code.adoption import packages, snapshot_of, with_adoption, write_snapshot
from pipeline.code.snapshot import Snapshot, identity_file
from pipeline.console.log_handler import in_one_line
from pipeline.errors import Errors, StoreError
from pipeline.maintenance.commands import CommandResult
from pipeline.maintenance.why import explain
from pipeline.parameters import parameter_errors
from pipeline.store import Store
from pipeline.task import StoredTask


def why(store: Store, options: Namespace) -> CommandResult:
    """Explains why tasks would run: their differences from the nearest artifact."""
    user_errors = [error for kind in families(options.module) for error in kind.user_errors]
    invalid: Errors = (ParameterException, TaskClassException, *user_errors)
    arguments = ["--module", options.module, *options.task]
    if not options.task:
        raise StoreError("`why` needs a task, as Luigi does: TASK --parameter value ...")
    try:
        with parameter_errors(), CmdlineParser.global_instance(arguments) as parser:
            return 0, list(explain(parser.get_task_obj(), store))
    except invalid as error:
        raise StoreError(in_one_line(error)) from error


def snapshot(_store: object, options: Namespace) -> CommandResult:
    """Writes the code of all families to a file, for review, and lists the changed families."""
    before, now = _old_and_new(options.module)
    write_snapshot(dataclasses.replace(now, adopted=before.adopted))
    pairs = {f: (before.families.get(f), code) for f, code in now.families.items()}
    return 0, [{"family": f, "then": a, "now": b} for f, (a, b) in pairs.items() if a != b]


def adopt(_store: object, options: Namespace) -> CommandResult:
    """Declares that edits of the code changed no result, so that nothing is built again."""
    before, now = _old_and_new(options.module)
    after = dataclasses.replace(before, code=now.code)
    for family in options.family:
        if family not in now.families:
            known = ", ".join(sorted(now.families))
            raise StoreError(f"{options.module} has no stage {family}. Its stages are {known}.")
        after = with_adoption(after, family, now.families[family], options.reason)
    write_snapshot(after)
    return 0, [dict(entry) for entry in after.adopted[len(before.adopted) :]]


def families(module: str) -> list[type[StoredTask]]:
    """Returns the stored tasks of a package that build something."""
    _import(module)
    kinds = StoredTask.__subclasses__()
    for kind in kinds:
        kinds += [each for each in kind.__subclasses__() if each not in kinds]
    ours = [kind for kind in kinds if kind.__module__.split(".")[0] == module.split(".")[0]]
    return [kind for kind in ours if kind.build is not StoredTask.build]


def _old_and_new(module: str) -> tuple[Snapshot, Snapshot]:
    """Returns the snapshot in the file, and the one of the present code."""
    then, now = Snapshot.read(), snapshot_of(families(module))
    others = packages(then) - {module.split(".")[0]}
    if others:
        raise StoreError(
            f"{identity_file()} is the snapshot of {', '.join(sorted(others))}."
            f" Name another file for {module} as [store] identity in `luigi.cfg`."
        )
    return then, now


def _import(module: str) -> None:
    try:
        importlib.import_module(module)
    except ImportError as error:
        raise StoreError(f"--module {module} cannot be imported: {error}") from error
