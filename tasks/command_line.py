"""The steps of a command of this package before and after Luigi runs its stages.

`python -m tasks TASK ...` and `luigi --module tasks TASK ...` are the same command: both reach
`pipeline.command.run_command` with the `begin` and the `end` of this file.
"""

import contextlib
import logging
from collections.abc import Iterator, Sequence

import luigi

from pipeline.command import run_command
from pipeline.console.progress_client import progress_client
from pipeline.errors import StoreError
from pipeline.maintenance.task_graph import upstream_first
from pipeline.task import artifact
from styletrf.errors import InputError
from tasks.command.build_order import seconds_ahead
from tasks.command.outcomes import outcome_of_missing
from tasks.command.sources import begin_of_command
from tasks.planning.plan_report import print_plan
from tasks.planning.validation import validate_command
from tasks.results.grid import Grid
from tasks.results.trajectory import StylizedTrajectory
from tasks.stages.linked_results import LinkedStage, link_results
from tasks.stages.stage import Stage
from tasks.summary.gallery import refresh_gallery
from tasks.summary.grid_summary import finish_command
from tasks.summary.lineage import write_lineages

LIBRARIES = ("torch", "numba", "cv2", "av", "PIL.Image", "luigi", "jsonschema")
"""The libraries that most stages import, and that take longest."""
_log = logging.getLogger("pipeline")


def begin(root: luigi.Task) -> None:
    """Validates a command that has something to make, or prints its plan.

    Args:
        root: The task of the command.

    Raises:
        SystemExit: With the error of the command; or, after a plan, with status 0.
    """
    try:
        if isinstance(root, Grid):
            root.validate()
        if isinstance(root, StylizedTrajectory | Grid) and (root.plan or root.json):
            _plan(root)
            raise SystemExit(0)
        for cell in _cells(root):
            cell.choose_settings()
        if root.complete():  # type: ignore[no-untyped-call]
            return
        stages = validate_command(root)
    except (InputError, StoreError) as error:
        raise SystemExit(str(error)) from error
    if client := progress_client():
        client.start_total(seconds_ahead(stages))


def end(root: luigi.Task) -> int | None:
    """Links the results, whoever made them, and prints where they are, or why they are missing.

    Args:
        root: The task of the command.

    Returns:
        The exit status; None if Luigi's is right.
    """
    status = None
    results = _results(root)
    with _reported():
        shown = set(link_results(_cells(root)))
        for result in results:
            if result in shown or result.complete():
                print(result.folder / result.page)  # noqa: T201  the command's answer
            elif not isinstance(root, Grid):
                _log_reason(result)
        if isinstance(root, Stage) and not results:
            _answer_for(root)
    with _reported():
        write_lineages(results)
        if isinstance(root, Grid):
            status = finish_command(root)
        elif results:
            refresh_gallery(root)
    return status


def run(arguments: Sequence[str]) -> int:
    """Runs a command; returns its exit status."""
    return run_command(arguments, begin, end, LIBRARIES)


def _plan(root: StylizedTrajectory | Grid) -> None:
    """Validates a command and prints its plan."""
    if not root.plan:
        raise InputError("--json", "is for --plan only", "Add --plan, or leave it out")
    validate_command(root)
    print_plan(root, as_json=bool(root.json))


def _cells(root: luigi.Task) -> list[StylizedTrajectory]:
    """Returns the stylized trajectories that a command requests."""
    if isinstance(root, Grid):
        return root.cells()
    return [root] if isinstance(root, StylizedTrajectory) else []


def _results(root: luigi.Task) -> list[LinkedStage]:
    """Returns the stages of a command that are shown in `out/`, each after those that it needs."""
    if cells := _cells(root):
        return [result for cell in cells for result in cell.cells()]
    return [stage for stage in upstream_first(root) if isinstance(stage, LinkedStage)]


def _answer_for(stage: Stage) -> None:
    """Prints the folder of a stage that is not a result, or logs why there is none."""
    if stage.complete():
        print(artifact(stage))  # noqa: T201  the command's answer
    else:
        _log_reason(stage)


def _log_reason(result: Stage) -> None:
    """Logs why a result does not exist."""
    try:
        found = outcome_of_missing(result, since=begin_of_command())
    except InputError:  # the command was refused with this very error
        return
    if found.outcome in ("failed", "late"):
        _log.error("%s was not made. %s: %s", result.label, found.stage, found.reason)


@contextlib.contextmanager
def _reported() -> Iterator[None]:
    """Logs an exception, so that the rest is done nevertheless."""
    try:
        yield
    except Exception:  # noqa: BLE001  whatever it is, the results are there
        _log.exception("The end of the command failed")
