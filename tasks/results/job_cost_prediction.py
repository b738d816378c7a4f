"""Predicts what a whole fly-through costs here at each quality, for `job_costs`."""

import json
import sys
from dataclasses import asdict

from tasks.planning.remaining_time import cost_model, stages_to_make
from tasks.results.job_costs import JobCost
from tasks.results.trajectory import StylizedTrajectory


def main(parameters: str, *qualities: str) -> None:
    """Writes the costs of a job at each quality as JSON; its parameters are JSON, too."""
    costs = {}
    for quality in qualities:
        job = StylizedTrajectory(**{**json.loads(parameters), "quality": quality})
        model = cost_model(job)
        stages = stages_to_make(job, lambda _: False)
        expected = {stage.task_family: model.expected(stage) for stage in stages}
        costs[quality] = JobCost(
            sum(cost.seconds for cost in expected.values()),
            expected["RadianceField"].seconds,
            max(cost.peak_memory_bytes for cost in expected.values()),
            sum(cost.output_bytes for cost in expected.values()),
        )
    sys.stdout.write(f"{json.dumps({q: asdict(cost) for q, cost in costs.items()})}\n")
