"""How fast a machine is, measured once and kept for it alone."""

import json
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

import tasks
from tasks.machine import local_facts
from tasks.machine.calibration import (
    CALIBRATIONS,
    Calibration,
    calibration_of_machine,
    keep_calibration,
    this_machine,
    workload_of,
)
from tasks.machine.local_facts import add_fact, facts_file, read_facts

SECONDS = {"poses": 1.0, "field": 2.0, "network": 3.0}


@pytest.fixture(autouse=True)
def _fresh():
    calibration_of_machine.cache_clear()


def calibration(**changes) -> Calibration:
    return Calibration(replace(this_machine("cpu"), **changes), SECONDS, "2026-01-01")


def test_what_was_kept_is_found_again():
    keep_calibration(calibration())
    assert calibration_of_machine("cpu") == calibration()


@pytest.mark.parametrize(
    "changes", [{"processor": "another"}, {"cores": 99}, {"versions": {"torch": "0"}}]
)
def test_another_machine_or_version_has_another_calibration(changes):
    keep_calibration(calibration(**changes))
    keep_calibration(calibration())
    assert len(read_facts(CALIBRATIONS)) == 2
    assert calibration_of_machine("cpu").machine == this_machine("cpu")


def test_a_damaged_file_counts_as_empty_and_is_replaced_whole():
    facts_file(CALIBRATIONS).write_text('{"a": ')
    assert read_facts(CALIBRATIONS) == {}
    add_fact(CALIBRATIONS, "b", 1)
    assert json.loads(facts_file(CALIBRATIONS).read_text()) == {"b": 1}
    assert [p.name for p in facts_file(CALIBRATIONS).parent.glob(".*partial*")] == []


def test_facts_that_are_added_at_once_are_all_kept(monkeypatch):
    """Two workers of a grid keep the choices of their budgets."""

    def read_slowly(name):
        known = read_facts(name)
        time.sleep(0.02)
        return known

    monkeypatch.setattr(local_facts, "read_facts", read_slowly)
    with ThreadPoolExecutor() as pool:
        list(pool.map(lambda number: add_fact("choices", str(number), number), range(4)))
    assert read_facts("choices") == {str(number): number for number in range(4)}


def test_every_stage_has_a_workload():
    families = set(tasks.__all__) - {"Grid"}
    assert {workload_of(family) for family in families} == SECONDS.keys()


def test_a_stage_is_as_much_slower_as_its_workload():
    slow = replace(calibration(), seconds={**SECONDS, "field": 5.0})
    assert slow.times_slower_than(calibration(), "RadianceField") == 2.5
    assert slow.times_slower_than(calibration(), "StyleNetwork") == 1.0
