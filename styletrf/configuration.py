"""Configurations from plain values, as a settings table or a user gives them."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from types import UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from styletrf.errors import InputError

Config = TypeVar("Config")
_KINDS = {bool: "true or false", int: "a whole number", float: "a finite number", str: "a text"}


def configured(config: type[Config], values: Mapping[str, Any]) -> Config:
    """Returns the configuration with its defaults replaced by `values`.

    A name with dots reaches into a nested configuration: `network.width`. Lists become tuples, and
    whole numbers floats where these are declared.

    Raises:
        InputError: A name is unknown, or a value is not of the declared type, not finite, or
            refused by the configuration.
    """
    result = config()
    for name, value in values.items():
        result = _replaced(result, name.split("."), value, name)
    return result


def require_at_least(least: int, config: Any, *names: str) -> None:
    """Refuses a configuration whose numbers by these names are too small.

    Raises:
        ValueError: A number is too small.
    """
    for name in names:
        if not getattr(config, name) >= least:
            raise ValueError(f"{name} is {getattr(config, name)}, not at least {least}")


def _replaced(config: Any, path: list[str], value: Any, name: str) -> Any:
    fields = get_type_hints(type(config))
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
        new = _declared(fields[path[0]], value, name)
    try:
        return dataclasses.replace(config, **{path[0]: new})
    except ValueError as error:
        raise InputError(f"setting {name!r}", str(error), "Give another value") from error


def _declared(hint: Any, value: Any, name: str) -> Any:
    """Returns a value as it is declared.

    Raises:
        InputError: It is of another type, or not finite.
    """
    try:
        return _of_type(hint, value)
    except (TypeError, OverflowError) as error:
        if get_origin(hint) is Literal:
            problem, known = f"{value!r} is unknown", ", ".join(map(str, get_args(hint)))
            raise InputError(f"setting {name!r}", problem, f"Choose one of {known}") from error
        kind = _KINDS.get(hint) or (hint if get_args(hint) else hint.__name__)
        problem = f"{value!r} is not {kind}"
        raise InputError(f"setting {name!r}", problem, "Give a value of that kind") from error


def _of_type(hint: Any, value: Any) -> Any:
    """Returns a value as a type hint has it.

    Raises:
        TypeError: It is of another type, or not finite.
        OverflowError: It is a whole number, and no float is as large.
    """
    if get_origin(hint) is Literal and value in get_args(hint):
        return value
    if get_origin(hint) is UnionType:
        return _of_one_type(get_args(hint), value)
    if get_origin(hint) is tuple and isinstance(value, list | tuple):
        return _of_types(get_args(hint), value)
    if hint is float and type(value) is int:
        value = float(value)
    if type(value) is not hint or (hint is float and not math.isfinite(value)):
        raise TypeError(f"{value!r} is not {hint}")
    return value


def _of_one_type(hints: Sequence[Any], value: Any) -> Any:
    """Returns a value as the first of some types that it is of."""
    for hint in hints:
        with suppress(TypeError):
            return _of_type(hint, value)
    raise TypeError(f"{value!r} is none of {hints}")


def _of_types(hints: Sequence[Any], values: Sequence[Any]) -> tuple[Any, ...]:
    """Returns a tuple of the types, or of however many of the first, if an ellipsis follows it."""
    if hints[-1] is Ellipsis:
        hints = [hints[0]] * len(values)
    if len(values) != len(hints):
        raise TypeError(f"{values!r} are not {len(hints)}")
    return tuple(_of_type(hint, value) for hint, value in zip(hints, values, strict=True))
