"""Settings by their names of earlier versions, which still work in this version."""

import functools
import logging
from collections.abc import Mapping
from typing import Any

from styletrf.errors import InputError

_log = logging.getLogger("pipeline")

_PRESENT: Mapping[str, Mapping[str, str]] = {
    "CameraPoses": {"neighbours": "neighbors", "video_neighbours": "video_neighbors"},
    "StyleNetwork": {"steadiness": "temporal_loss"},
}
"""The present names of fields by their former ones, by stage; the parts of a field keep theirs."""


def with_present_names(family: str, settings: Mapping[str, Any]) -> Mapping[str, Any]:
    """Returns settings of a stage by their present names; warns once of each former name.

    A former name whose present one is given as well stays, for `require_one_name` to refuse.
    """
    names = {name: _present_name(family, name) for name in settings}
    given = {_field(name) for name in settings}
    for former, present in names.items():
        if former != present and _field(present) in given:
            names[former] = former
        elif former != present:
            _warn_of_former_name(family, former, present)
    return {names[name]: value for name, value in settings.items()}


def require_one_name(family: str, settings: Mapping[str, Any]) -> None:
    """Refuses a setting of a stage that is given by both of its names.

    Raises:
        InputError: It names both.
    """
    for former in settings:
        if (present := _present_name(family, former)) != former:
            problem = f"is the former name of {present}, which is given as well"
            raise InputError(f"setting {former!r} of {family}", problem, f"Give {present} only")


def _field(name: str) -> str:
    return name.partition(".")[0]


def _present_name(family: str, name: str) -> str:
    field, dot, part = name.partition(".")
    return _PRESENT.get(family, {}).get(field, field) + dot + part


@functools.cache
def _warn_of_former_name(family: str, former: str, present: str) -> None:
    _log.warning("The setting %s of %s is now %s; use the new name.", former, family, present)
