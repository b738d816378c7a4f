"""Luigi's parameters with an error in one line: the flag, the wrong value and the allowed values.

Luigi itself ends the command with a trace that names neither the flag nor the task.
"""

import contextlib
import json
import math
import unicodedata
from collections.abc import Iterator, Sequence
from typing import Any

import luigi
from luigi.parameter import ParameterException


class _Flag:
    """A parameter that knows its flag, and describes its values in `allowed`."""

    flag = ""
    allowed = ""

    def __set_name__(self, owner: type, name: str) -> None:
        """Sets the flag. Python calls this when a class declares the parameter."""
        super().__set_name__(owner, name)  # type: ignore[misc]
        self.flag = f"--{name.replace('_', '-')}"

    def parse(self, x: str) -> Any:
        """Returns the value of a word of the command line.

        Raises:
            ParameterException: The value is not allowed.
        """
        try:
            return super().parse(x)  # type: ignore[misc]
        except (ValueError, TypeError) as error:
            message = f"{self.flag} {x}: this is not {self.allowed}"
            raise ParameterException(message) from error


class ChoiceParameter(_Flag, luigi.ChoiceParameter):
    """One of several words."""

    def __init__(self, *, choices: Sequence[str], **kwargs: Any) -> None:
        super().__init__(choices=choices, **kwargs)
        named = [choice for choice in choices if choice]
        self.allowed = f"one of {', '.join(named)}"
        described = kwargs.get("description") or ""  # Luigi adds the choices in a random order
        self.description = f"{described}: {self.allowed}" if described else self.allowed


class FloatParameter(_Flag, luigi.FloatParameter):
    """A finite number of 0 or more."""

    allowed = "a number of 0 or more, such as 0.5"

    def parse(self, x: str) -> float:
        """Returns the number.

        Raises:
            ParameterException: The text is not a finite number of 0 or more.
        """
        value = float(super().parse(x))
        if not 0 <= value < math.inf:
            raise ParameterException(f"{self.flag} {x}: this is not {self.allowed}")
        return value


class IntParameter(_Flag, luigi.IntParameter):
    """A whole number."""

    allowed = "a whole number, such as 2"


class _JsonFlag(_Flag):
    """A JSON value of one type."""

    kind: type

    def parse(self, x: str) -> Any:
        """Returns the value.

        Raises:
            ParameterException: The text is not JSON of this type.
        """
        value = super().parse(x)
        if x and not isinstance(json.loads(x), self.kind):
            raise ParameterException(f"{self.flag} {x}: this is not {self.allowed}")
        return value


class DictParameter(_JsonFlag, luigi.DictParameter):
    """A mapping."""

    kind = dict
    allowed = """a JSON object, such as '{"name": 1}'"""


class ListParameter(_JsonFlag, luigi.ListParameter):
    """A list."""

    kind = list
    allowed = """a JSON list, such as '["first", "second"]'"""


class NameParameter(luigi.Parameter):
    """The name of a file or folder, with each accent in one character with its letter (NFC).

    macOS stores accents apart from their letters. So one name has two forms, and would have two
    keys and two folders of results.
    """

    def normalize(self, x: Any) -> Any:
        """Returns the name in this form."""
        return _composed(x)


class NamesParameter(ListParameter):
    """A list of names, each as in `NameParameter`."""

    def normalize(self, x: Any) -> Any:
        """Returns the names in this form."""
        return tuple(map(_composed, super().normalize(x)))  # type: ignore[no-untyped-call]


class WeightsParameter(DictParameter):
    """Numbers by name, each name as in `NameParameter`."""

    def normalize(self, x: Any) -> Any:
        """Returns them by the names in this form."""
        composed = {_composed(name): value for name, value in x.items()}
        return super().normalize(composed)  # type: ignore[no-untyped-call]


class BoolParameter(_Flag, luigi.BoolParameter):
    """A flag that is given or not."""

    allowed = "true or false"


def _composed(name: Any) -> Any:
    return unicodedata.normalize("NFC", name) if isinstance(name, str) else name


@contextlib.contextmanager
def parameter_errors() -> Iterator[None]:
    """Raises the error of a parameter instead of Luigi's error that has it as its cause.

    Luigi wraps the errors of parameters that the task of the command does not have itself.
    """
    try:
        yield
    except ValueError as error:
        if isinstance(error.__cause__, ParameterException):
            raise error.__cause__ from None
        raise


def workers_of_command() -> int:
    """Returns how many builds the command of this process runs at once (`--workers`)."""
    return max(1, int(luigi.interface.core().workers))  # type: ignore[no-untyped-call]
