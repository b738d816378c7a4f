"""What another interpreter answers."""

import subprocess

import pytest

from pipeline.code.interpreters import json_from, json_of_last_line


@pytest.mark.parametrize("before", ["", "a library\n", "half a\n\n"])
@pytest.mark.parametrize("end", ["", "\n"])
def test_the_last_line_of_an_output_is_its_json_whatever_libraries_wrote_before(before, end):
    assert json_of_last_line(f'{before}{{"a": [1]}}{end}') == {"a": [1]}


@pytest.mark.parametrize("output", ["", "\n", "a library", '{"a": 1}\nan end'])
def test_an_output_without_json_at_its_end_is_a_value_error(output):
    with pytest.raises(ValueError):  # noqa: PT011  any
        json_of_last_line(output)


def test_an_answer_of_a_function_is_its_last_line():
    assert json_from("builtins:print", 'a library\n{"a": 1}') == {"a": 1}


@pytest.mark.parametrize("answer", ["", "no JSON"])
def test_a_function_that_answers_no_json_has_failed(answer):
    with pytest.raises(subprocess.CalledProcessError):
        json_from("builtins:print", answer)
