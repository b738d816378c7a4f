"""Configurations from plain values, as a settings table or a user gives them."""

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal, TypeVar, get_args, get_origin

from styletrf.errors import InputError

Config = TypeVar("Config")


def configured(config: type[Config], values: Mapping[str, Any]) -> Config:
    """Returns the configuration with its defaults replaced by `values`.

    A name with dots reaches into a nested configuration: `network.width`. Lists become tuples.

    Raises:
        InputError: A name is unknown, or a value is not of the default's type or among its words.
    """
    result = config()
    for name, value in values.items():
        result = _replaced(result, name.split("."), value, name)
    return result


def _replaced(config: Any, path: list[str], value: Any, name: str) -> Any:
    fields = {field.name: field.type for field in dataclasses.fields(config)}
    if path[0] not in fields:
        known = ", ".join(sorted(fields))
        raise InputError(
            f"setting {name!r}", f"{type(config).__name__} has no such field", f"It has {known}"
        )
    present = getattr(config, path[0])
    if len(path) > 1:
        if not dataclasses.is_dataclass(present):
            raise InputError(f"setting {name!r}", f"{path[0]} has no parts", f"Set {path[0]!r}")
        new = _replaced(present, path[1:], value, name)
    else:
        new = _of_the_kind(present, value, name)
        _refuse_unknown_word(fields[path[0]], new, name)
    try:
        return dataclasses.replace(config, **{path[0]: new})
    except ValueError as error:
        raise InputError(f"setting {name!r}", str(error), "Give another value") from error


def _refuse_unknown_word(hint: Any, value: Any, name: str) -> None:
    if get_origin(hint) is Literal and value not in get_args(hint):
        known = ", ".join(map(str, get_args(hint)))
        raise InputError(f"setting {name!r}", f"{value!r} is unknown", f"Choose one of {known}")


def _of_the_kind(present: Any, value: Any, name: str) -> Any:
    if isinstance(value, list):
        value = tuple(value)
    if isinstance(present, float) and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if present is not None and type(value) is not type(present):
        raise InputError(
            f"setting {name!r}",
            f"{value!r} is not {type(present).__name__} as its default {present!r} is",
            "Give a value of that kind",
        )
    return value
