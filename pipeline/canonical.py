"""Canonical JSON: equal values have one text."""

import dataclasses
import enum
import json
import math
from collections.abc import Mapping, Set
from typing import TypeAlias

Json: TypeAlias = bool | int | float | str | list["Json"] | dict[str, "Json"] | None


def canonical(value: object) -> Json:
    """Returns the JSON form of a parameter, which is equal for equal values.

    A float that is a whole number becomes an integer, so 1 and 1.0 are equal. Tuples become lists,
    sets are sorted, enumeration members become their names, and a dataclass `{"@Name": fields}`.

    Raises:
        ValueError: The value is NaN or infinite.
        TypeError: The value has no canonical form, such as a path or another object.
    """
    match value:
        case enum.Enum():
            return value.name
        case None | bool() | str():
            return value
        case int():
            return int(value)
        case float() if math.isfinite(value):
            return int(value) if value.is_integer() else float(value)
        case float():
            raise ValueError(f"{value} cannot be part of a key")
        case Mapping():
            return {_name(name): canonical(item) for name, item in value.items()}
        case list() | tuple():
            return [canonical(item) for item in value]
        case Set():
            return sorted((canonical(item) for item in value), key=canonical_json)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [field.name for field in dataclasses.fields(value)]
        return {f"@{type(value).__name__}": {n: canonical(getattr(value, n)) for n in names}}
    raise TypeError(f"{value!r} ({type(value).__name__}) has no canonical form")


def canonical_json(value: object) -> bytes:
    """Returns the one JSON text of `canonical(value)`: ASCII, sorted keys, no spaces."""
    text = json.dumps(canonical(value), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return text.encode("ascii")


def _name(name: object) -> str:
    if not isinstance(name, str) or name.startswith("@"):
        raise TypeError(f"{name!r} is not a name of a parameter: use a string that has no @ first")
    return name
