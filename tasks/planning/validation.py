"""Validation of a command before anything long begins.

The names and types of settings, and the presence of a GPU, are checked by libraries that Luigi's
process does not load. So another process checks them (`request_validation`).
"""

import dataclasses
import json
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import luigi

from pipeline.execution.fork_server import output_of
from pipeline.maintenance.task_graph import upstream_first
from pipeline.settings import current_store
from styletrf.errors import InputError
from tasks.command.root_task import is_typed
from tasks.command.sources import may_stop, sources_of, unreadable_sources
from tasks.planning.stage_demands import demands_of
from tasks.stages.field import TrajectoryFrames
from tasks.stages.scene import SceneCapture
from tasks.stages.stage import ConfigurableStage, PresetStage, Stage

LEAST_ROOM_BYTES = 64 << 20  # free disk space that a command needs to begin


def validate_command(root: luigi.Task) -> Sequence[luigi.Task]:
    """Returns the stages of a command; ends a command that is bound to fail.

    Args:
        root: The task of the command.

    Raises:
        InputError: A budget or a combination of parameters is invalid, or a setting has no effect.
        SystemExit: A source is not there; it has one line for each. Or a setting, the device or a
            video is invalid, or they could not be checked.
    """
    stages = list(upstream_first(root))
    sources_of(root)  # once, before workers are forked
    expected = [s.expected_result() for s in stages if hasattr(s, "expected_result")]
    checked = list(upstream_first(root, *expected))
    for stage in checked:
        if hasattr(stage, "validate"):  # Luigi's own tasks do not
            stage.validate()
    require_effect(checked)
    if problems := list(dict.fromkeys(unreadable_sources(root))):
        raise SystemExit("\n".join(problems))
    for stage in stages:
        if hasattr(stage, "require_reachable"):  # it may measure how fast this machine is
            stage.require_reachable()
    require_room(current_store().root)
    demands = demands_of(checked) if may_stop(root) else []
    request = {
        "tuned": sorted({n for s in checked if isinstance(s, PresetStage) for n in s.tuning}),
        "cuda": any(isinstance(stage, Stage) and stage.device == "cuda" for stage in checked),
        "settings": sorted(set(_given_settings(checked))),
        "paths": sorted({path for stage in checked if (path := _path_of(stage))}),
        "memory": [dataclasses.asdict(demand) for demand in demands],
        "free_bytes": shutil.disk_usage(current_store().root).free if demands else 0,
    }
    if any(request.values()) and (error := _validation_error(request)):
        raise SystemExit(error)
    return stages


def require_room(root: Path) -> None:
    """Rejects a disk that is too full for even the first stages.

    Raises:
        InputError: Less than LEAST_ROOM_BYTES are free.
    """
    free = shutil.disk_usage(root).free
    if free < LEAST_ROOM_BYTES:
        raise InputError(
            f"the disk of {root}",
            f"has {free >> 20} MiB free; a scene in one style takes about 300",
            "Free some space (python -m pipeline gc), or set STYLETRF_STORE to another disk",
        )


def require_effect(stages: Sequence[luigi.Task]) -> None:
    """Refuses settings of the command line that all stages of a family drop from their values.

    Such are those of a network that is not trained. Those of `luigi.cfg` are for other commands,
    too.
    """
    unused = dict[str, set[str]]()
    for stage in stages:
        if isinstance(stage, ConfigurableStage) and _has_typed_settings(stage):
            ignored = set(stage.settings) - set(stage.values())
            unused[stage.task_family] = unused.get(stage.task_family, ignored) & ignored
    for family, names in unused.items():
        if names:
            subject = f"{', '.join(sorted(names))} of --{family}-settings"
            problem = "has no effect beside the other options of this command"
            raise InputError(subject, problem, "Leave it out")


def _has_typed_settings(stage: ConfigurableStage) -> bool:
    return is_typed(f"{stage.task_family}_settings") or bool(
        stage.settings and is_typed("settings")
    )


def _given_settings(stages: Sequence[luigi.Task]) -> Iterator[tuple[str, str]]:
    """Yields each stage that the user gave settings, by name, with all its settings as JSON."""
    configurable = [stage for stage in stages if isinstance(stage, ConfigurableStage)]
    own = {stage.task_family: stage.settings for stage in configurable if stage.settings}
    for stage in configurable:
        if stage.settings:
            yield stage.task_family, json.dumps(stage.values())
    for preset in (stage for stage in stages if isinstance(stage, PresetStage)):
        for family in preset.tuning:  # also those of which the command has no stage
            yield family, json.dumps(preset.tuned(family, preset.quality, own.get(family)))


def _path_of(stage: luigi.Task) -> tuple[str, str, str] | None:
    """Returns the file of the camera path, the scene and the settings of its capture, as JSON.

    None, if the stage has no such file.
    """
    if isinstance(stage, TrajectoryFrames) and stage.path_file() is not None:
        capture = stage.upstream(SceneCapture).values()
        return str(stage.path), str(stage.scene), json.dumps(capture)
    return None


def _validation_error(request: dict[str, Any]) -> str:
    """Returns the error that another process finds, or that it failed; "" if there is none."""
    try:
        return output_of("tasks.planning.request_validation:main", json.dumps(request)).strip()
    except RuntimeError as error:
        return f"The command could not be checked: {error}. What it wrote above may say why."
