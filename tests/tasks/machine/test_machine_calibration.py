"""How fast a machine is, measured now and then, and kept for it alone."""

import json
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from datetime import UTC, datetime, timedelta

import pytest
from expected_errors import rejects

import tasks
from pipeline.execution.environment import build_environment, build_settings
from tasks.machine import calibration as calibrations
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


def kept(**changes) -> Calibration:
    return keep_calibration(replace(this_machine("cpu"), **changes), SECONDS)


def test_what_was_kept_is_found_again():
    assert kept() == calibration_of_machine("cpu")


@pytest.mark.parametrize(
    "changes",
    [
        {"processor": "another"},
        {"cores": 99},
        {"versions": {"torch": "0"}},
        {"environment": {"GOMP_SPINCOUNT": "5"}},
    ],
)
def test_another_machine_version_or_environment_has_another_calibration(changes):
    kept(**changes)
    kept()
    assert len(read_facts(CALIBRATIONS)) == 2
    assert calibration_of_machine("cpu").machine == this_machine("cpu")


@pytest.mark.parametrize(("days", "is_measured"), [(29, False), (31, True)])
def test_a_calibration_is_measured_again_after_thirty_days(monkeypatch, days, is_measured):
    measured = {**SECONDS, "field": 9.0}
    monkeypatch.setattr(calibrations, "_measured", lambda _device: measured)
    day = datetime.now(UTC).date() - timedelta(days)
    add_fact(CALIBRATIONS, this_machine("cpu").digest, {**asdict(kept()), "measured": f"{day}"})
    assert calibration_of_machine("cpu").seconds == (measured if is_measured else SECONDS)


def test_workloads_are_measured_in_the_environment_of_builds(monkeypatch):
    """Beside a busy thread they were a hundred times slower than a build, and kept for ever."""
    asked = []
    for name in (*build_settings({}), "OMP_WAIT_POLICY", "GLIBC_TUNABLES"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(calibrations, "json_from", lambda *_, **given: asked.append(given) or {})
    calibration_of_machine("cpu")
    assert asked[0]["environment"] == build_environment()
    assert this_machine("cpu").environment.items() >= build_settings({}).items()


def test_a_machine_that_cannot_be_measured_is_one_line(monkeypatch):
    """It was a traceback, such as for `--device cuda` without a GPU."""

    def failed(*_arguments, **_options):
        error = subprocess.CalledProcessError(1, "python")
        error.add_note("Traceback\nRuntimeError: no GPU")
        raise error

    monkeypatch.setattr(calibrations, "json_from", failed)
    with rejects("--device cpu", "no GPU") as refused:
        calibration_of_machine("cpu")
    assert "\n" not in str(refused.value)


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
    slow = replace(kept(), seconds={**SECONDS, "field": 5.0})
    assert slow.times_slower_than(kept(), "RadianceField") == 2.5
    assert slow.times_slower_than(kept(), "StyleNetwork") == 1.0
