"""How long tests take: which of them are `slow`, and which files begin first.

`make test TEST_ARGS="... --junitxml=suite.xml"` and `python tests/durations.py suite.xml` write
`durations.json` again, from a run of the whole suite with nothing beside it.
"""

import json
import sys
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import pytest

DURATIONS = Path(__file__).with_name("durations.json")
SLOW_S, SLOW_FILE_S = 0.3, 6.0
"""Seconds from which a test is slow and listed, and of its slow tests from which a whole file is
slow: tests of a file often share what the first of them makes."""


@pytest.hookimpl(tryfirst=True)  # before `-m` selects
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks slow tests, and lets the longest files begin first, so that no worker ends alone."""
    seconds: dict[str, float] = json.loads(DURATIONS.read_text())
    of_files: Counter[str] = Counter()
    for test, duration_s in seconds.items():
        of_files[file_of(test)] += duration_s  # type: ignore[assignment]
    for item in items:
        if item.nodeid in seconds or of_files[file_of(item.nodeid)] >= SLOW_FILE_S:
            item.add_marker("slow")
    items.sort(key=lambda item: -of_files[file_of(item.nodeid)])


def file_of(test: str) -> str:
    """Returns the file of a test from its name, `FILE::FUNCTION[PARAMETERS]`."""
    return test.partition("::")[0]


def durations(report: Path) -> dict[str, float]:
    """Returns the seconds of the tests that take some, from a JUnit report."""
    cases = ElementTree.parse(report).getroot().iter("testcase")
    named = {
        f"{case.attrib['classname'].replace('.', '/')}.py::{case.attrib['name']}": case
        for case in cases
    }
    seconds = {test: round(float(case.attrib["time"]), 1) for test, case in named.items()}
    return {test: each for test, each in sorted(seconds.items()) if each >= SLOW_S}


if __name__ == "__main__":
    DURATIONS.write_text(json.dumps(durations(Path(sys.argv[1])), indent=1) + "\n")
