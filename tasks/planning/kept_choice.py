"""The settings chosen for a request, kept: the same command continues with its first choice.

Finished stages of a command take no more time, so without a memory a budget would buy better
settings with every run.
"""

from dataclasses import asdict, replace
from typing import Any

from pipeline.canonical import canonical_json
from pipeline.digest import typed_digest
from styletrf.evaluation.trade_off import Combination
from tasks.command.sources import builds_alone
from tasks.machine.local_facts import add_fact, read_facts
from tasks.planning.remaining_time import timing_of
from tasks.presets.quality_choice import Choice, Front, choose
from tasks.presets.quality_request import QualityRequest

_CHOICES = "choices"


def choice_for(task: Any, request: QualityRequest, front: Front) -> Choice:
    """Returns the earlier choice for the task from this front, or else one that fits the request.

    Args:
        task: A `StylizedTrajectory` with the request.
        request: The request of the task.
        front: The front of the scene.

    Raises:
        InputError: No point of the front will do.
    """
    return _kept(task, front) or choose(request, front, timing_of(task))


def known_choice(task: Any, request: QualityRequest, front: Front) -> Choice | None:
    """Returns the choice of `choice_for` if it is known without measuring this machine.

    Where luigid hands stages to several machines, none is measured: all have to choose alike.

    Raises:
        InputError: No point of the front will do.
    """
    return _kept(task, front) if builds_alone() else choose(request, front, timing_of(task))


def keep_choice(task: Any, front: Front, choice: Choice) -> None:
    """Keeps the choice for the task from this front."""
    if builds_alone():
        point, quality = choice.point, choice.front.quality_of(choice.point)
        chosen = {"tuning": point.tuning, "stylizer": point.stylizer, "seconds": point.seconds}
        add_fact(_CHOICES, _key(task, front), {**chosen, "quality": quality})


def _kept(task: Any, front: Front) -> Choice | None:
    kept = read_facts(_CHOICES).get(_key(task, front)) if builds_alone() else None
    if not kept:
        return None
    quality = kept.get("quality", front.quality)  # earlier versions chose from the front alone
    for offer in front.offers():
        for point in offer.points:
            if offer.quality_of(point) == quality and _same(point, kept):
                return Choice(offer, replace(point, seconds=kept["seconds"]))
    return None


def _key(task: Any, front: Front) -> str:
    parameters = task.to_str_params(only_significant=True)
    points = [_without_newer_fields(point) for point in front.points]
    fields = {"words": parameters, "front": front.description, "points": points}
    return typed_digest("choice-v1", canonical_json(fields))


def _without_newer_fields(point: Combination) -> dict[str, Any]:
    """Returns the fields of a point; those that earlier versions lack only if they are given."""
    fields = asdict(point)
    newer = [name for name in ("consistency_ratio", "stylizer", "quality") if not fields[name]]
    return {name: value for name, value in fields.items() if name not in newer}


def _same(point: Combination, kept: Any) -> bool:
    is_same_stylizer = point.stylizer == kept.get("stylizer", "")
    return is_same_stylizer and canonical_json(point.tuning) == canonical_json(kept["tuning"])
