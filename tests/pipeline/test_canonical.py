import dataclasses
import enum
import hashlib
import json
import math
from pathlib import Path

import pytest
from expected_failures import refuses
from hypothesis import given
from hypothesis import strategies as st

from pipeline.canonical import canonical, canonical_json
from pipeline.digest import typed_digest
from pipeline.record import Action

scalars = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.text()
    | st.floats(allow_nan=False, allow_infinity=False)
)
names = st.text(min_size=1).filter(lambda name: not name.startswith("@"))
values = st.recursive(
    scalars, lambda inner: st.lists(inner) | st.dictionaries(names, inner), max_leaves=12
)


class Quality(enum.StrEnum):
    DRAFT = "a draft"


@dataclasses.dataclass(frozen=True)
class Config:
    rank: int
    rate: float


@given(values)
def test_canonical_is_a_projection(value):
    assert canonical(canonical(value)) == canonical(value)


@given(values)
def test_text_reads_back_as_the_same_value(value):
    assert canonical(json.loads(canonical_json(value))) == canonical(value)


@given(st.dictionaries(names, scalars))
def test_order_of_a_mapping_does_not_count(mapping):
    backwards = dict(reversed(mapping.items()))
    assert canonical_json(backwards) == canonical_json(mapping)


@given(st.integers(-(2**53), 2**53))
def test_a_whole_float_is_its_integer(number):
    assert canonical_json(float(number)) == canonical_json(number)


@given(values, values)
def test_different_values_have_different_texts(a, b):
    assert (canonical_json(a) == canonical_json(b)) == (
        canonical(a) == canonical(b) and _types(a) == _types(b)
    )


def _types(value):
    """The value with booleans distinguished from the numbers that Python takes them for."""
    return json.dumps(canonical(value), sort_keys=True)


def test_one_form_for_tuples_sets_members_and_dataclasses():
    assert canonical((1, 2.0)) == canonical([1, 2])
    assert canonical({3, 1, 2}) == [1, 2, 3]
    assert canonical(Quality.DRAFT) == "DRAFT"
    assert canonical(Config(rank=3, rate=0.5)) == {"@Config": {"rank": 3, "rate": 0.5}}
    assert canonical(True) is True
    assert canonical(-0.0) == 0


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_refused(number):
    with refuses(number, kind=ValueError):
        canonical({"x": [number]})


@pytest.mark.parametrize(
    "value", [Path("/a"), b"bytes", object(), {1: "a"}, {"@Config": 1}, Config]
)
def test_what_has_no_canonical_form_is_refused(value):
    with pytest.raises(TypeError):
        canonical(value)


def action(**changes):
    fields = {
        "family": "RadianceField",
        "code": "c" * 64,
        "parameters": {"seed": 1, "rate": 0.02},
        "inputs": {"poses": "a" * 64},
        "sources": {},
        "tools": {"torch": "2.13.0"},
    }
    return Action(**{**fields, **changes})


def test_the_key_of_a_known_action_stays_as_it_was():
    """These change only with a deliberate change of the scheme, which disowns every store."""
    preimage = b"\0\0\0\0\0\0\0\4kind" + b"\0\0\0\0\0\0\0\1a" + b"\0\0\0\0\0\0\0\0"
    assert typed_digest("kind", b"a", b"") == hashlib.sha256(preimage).hexdigest()
    assert action().key == "e2a513d033d63131a50e775b9a3b3af903f320b8cca35268e994957847cad4b4"
    assert action(parameters={"rate": 0.020, "seed": 1.0}).key == action().key


@given(st.dictionaries(names, values, max_size=3), st.dictionaries(names, values, max_size=3))
def test_equal_parameters_are_one_key_and_others_another(a, b):
    keys = {action(parameters=p).key for p in (a, dict(reversed(a.items())), canonical(a))}
    assert len(keys) == 1
    assert (action(parameters=b).key in keys) == (_types(a) == _types(b))


@given(st.dictionaries(names, values, min_size=1, max_size=3), values, st.data())
def test_any_change_of_a_parameter_is_another_key(parameters, value, data):
    name = data.draw(st.sampled_from(sorted(parameters)))
    changed = {**parameters, name: value}
    without = {n: v for n, v in parameters.items() if n != name}
    key = action(parameters=parameters).key
    assert (action(parameters=changed).key == key) == (_types(changed) == _types(parameters))
    assert action(parameters=without).key != key


@pytest.mark.parametrize(
    "change",
    [
        {"family": "Radiance"},
        {"code": "d" * 64},
        {"parameters": {"seed": 2, "rate": 0.02}},
        {"parameters": {"seed": True, "rate": 0.02}},
        {"parameters": {"seed": "1", "rate": 0.02}},
        {"inputs": {"pose": "a" * 64}},
        {"inputs": {"poses": "b" * 64}},
        {"inputs": {}, "sources": {"poses": "a" * 64}},
        {"tools": {"torch": "2.14.0"}},
        {"salt": "again"},
    ],
)
def test_every_field_of_an_action_counts(change):
    assert action(**change).key != action().key


def test_equal_bytes_in_other_parts_have_another_digest():
    digests = {
        typed_digest("k", b"ab", b"c"),
        typed_digest("k", b"a", b"bc"),
        typed_digest("k", b"abc"),
    }
    assert len(digests) == 3
    assert typed_digest("ka", b"b") != typed_digest("k", b"ab")
