"""A wrong value of a parameter is refused in one line that names the flag and what is allowed."""

import json
import unicodedata

import luigi
import pytest
from luigi.parameter import ParameterException

from pipeline.execution.deadline import Deadline
from pipeline.parameters import (
    BoolParameter,
    ChoiceParameter,
    DictParameter,
    FloatParameter,
    IntParameter,
    ListParameter,
    NameParameter,
    NamesParameter,
    WeightsParameter,
)


class Declared(luigi.Task):
    """One parameter of each kind."""

    word = ChoiceParameter(choices=["", "red", "green"], default="red")
    share = FloatParameter(default=1.0)
    how_often = IntParameter(default=1)
    shares = DictParameter(default={})
    names = ListParameter(default=[])
    is_quick = BoolParameter()
    place = NameParameter(default="")
    places = NamesParameter(default=[])
    weights = WeightsParameter(default={})
    until = Deadline(default=None)


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("word", "blue", "red, green"),
        ("share", "half", "number"),
        ("share", "-1", "number of 0 or more"),
        ("share", "inf", "number of 0 or more"),
        ("share", "nan", "number of 0 or more"),
        ("how_often", "1.5", "whole number"),
        ("shares", "{", "JSON object"),
        ("shares", '["a"]', "JSON object"),
        ("names", "a, b", "JSON list"),
        ("names", '"a"', "JSON list"),
        ("is_quick", "perhaps", "true or false"),
        ("until", "noon", "06:00"),
    ],
)
def test_wrong_value_names_flag_value_and_what_is_allowed(name, value, allowed):
    with pytest.raises(ParameterException) as raised:
        dict(Declared.get_params())[name].parse(value)
    message = str(raised.value)
    assert message.startswith(f"--{name.replace('_', '-')} {value}")
    assert allowed in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("name", "word", "value"),
    [
        ("word", "green", "green"),
        ("share", "0.5", 0.5),
        ("how_often", "3", 3),
        ("shares", '{"a": 1}', {"a": 1}),
        ("names", '["a"]', ["a"]),
        ("is_quick", "true", True),
    ],
)
def test_right_value_is_that_of_luigi(name, word, value):
    parsed = dict(Declared.get_params())[name].parse(word)
    assert (dict(parsed) if isinstance(value, dict) else parsed) == value


@pytest.mark.parametrize("form", ["NFC", "NFD"])
def test_a_name_is_one_name_however_its_accents_are_stored(form):
    """A name from a Mac's folder, and the same name typed, were two results."""
    name = unicodedata.normalize(form, "caf\xe9")
    given = {"place": name, "places": [name, "horns"], "weights": {name: 0.5}}
    words = {key: value if key == "place" else json.dumps(value) for key, value in given.items()}
    typed, made = Declared.from_str_params(words), Declared(**given)
    assert typed.task_id == made.task_id
    assert (made.place, made.places) == ("caf\xe9", ("caf\xe9", "horns"))
    assert dict(made.weights) == {"caf\xe9": 0.5}
