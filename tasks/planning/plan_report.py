"""`--plan`: prints the plan of a command as lines or as JSON."""

import json
from dataclasses import asdict
from typing import Any

from pipeline.execution.cpu_memory import usable_cores
from pipeline.parameters import workers_of_command
from styletrf.reports.page import duration
from tasks.planning.build_plan import BuildPlan, StagePlan, plan_of

_MOST_REASONS = 3  # that a line names


def print_plan(root: Any, *, as_json: bool) -> None:
    """Prints the plan of a command.

    Args:
        root: A `StylizedTrajectory` or a `Grid`.
        as_json: Print JSON instead of lines.

    Raises:
        InputError: No settings meet the bound.
    """
    plan = plan_of(root)
    print(plan_as_json(plan) if as_json else plan_as_text(plan))  # noqa: T201  the answer


def plan_as_json(plan: BuildPlan) -> str:
    """Returns the plan as JSON: `stages`, `totals` and `settings`."""
    stages = [
        {
            "task": stage.task.label,
            "family": stage.task.task_family,
            "state": "to make" if stage.cost else "found",
            "reasons": list(stage.reasons),
            **(asdict(stage.cost) if stage.cost else {}),
        }
        for stage in plan.stages
    ]
    fields = {"stages": stages, "totals": totals(plan), "settings": list(plan.settings)}
    return json.dumps(fields, indent=1)


def totals(plan: BuildPlan) -> dict[str, Any]:
    """Returns the totals of the stages to make, with the workers of this command and with one."""
    workers, cores = workers_of_command(), len(usable_cores())
    costs = [stage.cost for stage in plan.stages if stage.cost]
    return {
        "found": len(plan.stages) - len(costs),
        "to_make": len(costs),
        "workers": workers,
        "seconds": plan.seconds(workers, cores),
        "seconds_one_worker": plan.seconds(1, cores),
        "peak_memory_bytes": plan.peak_memory_bytes(workers),
        "peak_memory_bytes_one_worker": plan.peak_memory_bytes(1),
        "output_bytes": sum(cost.output_bytes for cost in costs),
    }


def plan_as_text(plan: BuildPlan) -> str:
    """Returns a line a stage, in columns, and the totals."""
    rows = [_row(stage) for stage in plan.stages]
    widths = [max((len(row[k]) for row in rows), default=0) for k in range(5)]
    lines = ["  ".join((*map(str.ljust, row[:5], widths), row[5])).rstrip() for row in rows]
    return "\n".join([*plan.settings, *lines, _total_line(plan)])


def _row(stage: StagePlan) -> tuple[str, ...]:
    if stage.cost is None:
        return stage.task.label, "found", "", "", "", ""
    reasons = list(stage.reasons[:_MOST_REASONS])
    if more := len(stage.reasons) - len(reasons):
        reasons.append(f"and {more} more")
    cost = stage.cost
    memory, size = f"{cost.peak_memory_bytes / 2**20:.0f} MiB", f"{cost.output_bytes / 1e6:.1f} MB"
    why = f"{'; '.join(reasons)} (cost by {cost.evidence})"
    return stage.task.label, "to make", duration(cost.seconds), memory, size, why


def _total_line(plan: BuildPlan) -> str:
    total = totals(plan)
    counts = f"{total['found']} found, {total['to_make']} to make"
    if not total["to_make"]:
        return counts
    time = f"{duration(total['seconds'])} with --workers {total['workers']}"
    memory = f"at most {total['peak_memory_bytes_one_worker'] / 2**20:.0f} MiB a stage"
    if total["workers"] > 1:
        time += f" ({duration(total['seconds_one_worker'])} with one)"
        memory += f" and {total['peak_memory_bytes'] / 2**20:.0f} MiB at once"
    return f"{counts}: {time}, {memory}, {total['output_bytes'] / 1e6:.1f} MB on disk"
