"""`python benchmarks/reference_costs.py SCENE STYLE`: what a draft took, as plans refer to it.

Run `luigi --module tasks StylizedTrajectory --scene SCENE --style STYLE --quality draft` before, in
an empty store. Writes `tasks/planning/reference_costs.json`: the calibration of this machine, the
size of the photographs, and of each stage the seconds less what other work took of the cores, the
CPU time, the peak memory and the bytes of the artifact.
"""

import argparse
import json
import os
from dataclasses import asdict

from pipeline.execution.cost_history import Cost
from pipeline.maintenance.task_graph import upstream_first
from pipeline.record import ActionRecord
from pipeline.task import StoredTask
from tasks import StylizedTrajectory
from tasks.machine.calibration import calibration_of_machine
from tasks.planning.scene_sizes import sizes_of
from tasks.planning.stage_costs import REFERENCE


def cost_of(record: ActionRecord) -> Cost:
    """Returns what a build took, without what other work cost it."""
    noted = {name: float(str(record.provenance[name])) for name in NUMBERS}
    cores = os.cpu_count() or 1
    own_s = noted["cpu_seconds"]
    quiet_s = max(noted["seconds"] - noted["other_cpu_seconds"] / cores, own_s / cores)
    memory = int(noted["peak_memory_bytes"])
    return Cost(round(quiet_s, 1), memory, round(own_s, 1), record.output.size)


NUMBERS = ("seconds", "cpu_seconds", "other_cpu_seconds", "peak_memory_bytes")


def main() -> None:
    """Read the records, and write the file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene")
    parser.add_argument("style")
    options = parser.parse_args()
    words = {"scene": options.scene, "style": options.style, "quality": "draft"}
    stages = list(upstream_first(StylizedTrajectory(**words)))
    records = {s.task_family: s.record() for s in stages if isinstance(s, StoredTask)}
    calibration = calibration_of_machine("cpu")
    fields = {
        "scene": options.scene,
        "style": options.style,
        "photographs": asdict(sizes_of((options.scene,))[options.scene]),
        "calibration": asdict(calibration),
        "stages": {family: asdict(cost_of(r)) for family, r in sorted(records.items()) if r},
    }
    REFERENCE.write_text(json.dumps(fields, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    main()
