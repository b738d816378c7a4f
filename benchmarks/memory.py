"""Predicted memory of stages beside what their builds took: `python benchmarks/memory.py`.

A row for each build of which the store (`STYLETRF_STORE`) keeps the cost, and whose photographs lie
in `STYLETRF_DATA`.
"""

import tasks
from pipeline.execution.cost_history import cost_history
from pipeline.settings import current_store
from tasks.planning.memory_demand import GROWTH, predicted_bytes
from tasks.planning.scene_photographs import photographs_of
from tasks.planning.stage_demands import demand_of

_MIB = 1 << 20


def main() -> None:
    """Prints the table."""
    _print_row(
        "stage", "scene", "quality", "frames, px", "predicted, MiB", "measured, MiB", "ratio"
    )
    _print_row(*["---"] * 7)
    for family in sorted({name.split()[0] for name in GROWTH}):
        for spent in cost_history(current_store(), family):
            stage = getattr(tasks, family).from_str_params(dict(spent.parameters))
            demand = demand_of(stage)
            photographs = photographs_of(demand.scene, demand.video_frames)
            if photographs is None:
                continue
            predicted = sum(predicted_bytes(demand, photographs).values()) / _MIB
            measured = spent.cost.peak_memory_bytes / _MIB
            size = demand.frame_px or demand.photograph_px
            found = f"{predicted:.0f}", f"{measured:.0f}", f"{predicted / measured:.2f}"
            _print_row(demand.stage, demand.scene, stage.quality, size, *found)


def _print_row(*cells: object) -> None:
    print(f"| {' | '.join(map(str, cells))} |")  # noqa: T201


if __name__ == "__main__":
    main()
