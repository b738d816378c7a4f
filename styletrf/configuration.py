"""Configurations from plain values, as a settings table or a user gives them."""

import dataclasses
import math
import operator
from collections.abc import Mapping, Sequence
from contextlib import suppress
from types import UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from styletrf.errors import InputError

Config = TypeVar("Config")
SEEDS = "[0, 2147483647]"
"""The seeds that every library takes."""
_KINDS = {bool: "true or false", int: "a whole number", float: "a finite number", str: "a text"}


def configured(config: type[Config], values: Mapping[str, Any]) -> Config:
    """Returns the configuration with its defaults replaced by `values`.

    A name with dots reaches into a nested configuration: `network.width`. Lists become tuples, and
    whole numbers floats where these are declared. The order of the values does not matter.

    Raises:
        InputError: A name is unknown, or a value is not of the declared type, not finite, or
            refused by the configuration.
    """
    try:
        result: Config = _replaced(config(), values)
    except ValueError as error:
        names = ", ".join(repr(name) for name in values if _is_refused_for(name, config(), values))
        subject = f"setting {names}" if names else f"settings of {config.__name__}"
        raise InputError(subject, str(error), "Give another value") from error
    return result


def require_at_least(least: int, config: Any, *names: str) -> None:
    """Refuses a configuration whose numbers by these names are too small.

    Raises:
        ValueError: A number is too small.
    """
    for name in names:
        if not getattr(config, name) >= least:
            raise ValueError(f"{name} is {getattr(config, name)}, not at least {least}")


def require_within(interval: str, config: Any, *names: str) -> None:
    """Refuses a configuration whose numbers by these names are not in an interval.

    Args:
        interval: Such as `[0, 1)`, from 0 to less than 1, or `(0, inf)`.
        config: The configuration.
        names: Those of its numbers.

    Raises:
        ValueError: A number is outside.
    """
    low, high = (float(bound) for bound in interval[1:-1].split(","))
    is_above = operator.ge if interval[0] == "[" else operator.gt
    is_below = operator.le if interval[-1] == "]" else operator.lt
    for name in names:
        value = getattr(config, name)
        if not (is_above(value, low) and is_below(value, high)):
            raise ValueError(f"{name} is {value}, not in {interval}")


def _replaced(config: Any, values: Mapping[str, Any], inside: str = "") -> Any:
    """Returns a configuration with values replaced at once, those of nested ones before it.

    So no configuration is checked while some of its values are still the former ones.

    Raises:
        ValueError: A configuration refuses its values.
    """
    hints = get_type_hints(type(config))
    new: dict[str, Any] = {}
    parts: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        first, dot, rest = name.partition(".")
        _require_field(config, hints, first, inside + name, has_parts=bool(dot))
        if dot:
            parts.setdefault(first, {})[rest] = value
        else:
            new[first] = _declared(hints[first], value, inside + name)
    for first, part in parts.items():
        whole = new.get(first, getattr(config, first))
        new[first] = _replaced(whole, part, f"{inside}{first}.")
    return dataclasses.replace(config, **new)


def _require_field(
    config: Any, fields: Mapping[str, Any], field: str, name: str, *, has_parts: bool
) -> None:
    """Raises an InputError where a setting's field is unknown, or has no parts but should."""
    if field not in fields:
        known = ", ".join(sorted(fields))
        raise InputError(
            f"setting {name!r}", f"{type(config).__name__} has no such field", f"It has {known}"
        )
    if has_parts and not dataclasses.is_dataclass(getattr(config, field)):
        raise InputError(f"setting {name!r}", f"{field} has no parts", f"Set {field!r}")


def _is_refused_for(name: str, config: Any, values: Mapping[str, Any]) -> bool:
    """Returns whether a configuration accepts all the refused values but that of one name."""
    with suppress(ValueError):
        _replaced(config, {other: value for other, value in values.items() if other != name})
        return True
    return False


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
