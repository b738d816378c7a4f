"""The deadline: which moment it is, and which builds do not start."""

import contextlib
import time
from datetime import UTC, datetime, timedelta

import luigi
import psutil
import pytest
from build_toys import Act
from commands import luigi as command
from expected_failures import refuses
from luigi.parameter import ParameterException
from message_words import mentions
from store_toys import Word, built

from pipeline.execution.cost_history import Cost, CostSample, record_cost
from pipeline.execution.cpu_memory import CpuAllocation
from pipeline.execution.deadline import Deadline
from pipeline.execution.resources import significant
from pipeline.maintenance.attempts import attempts
from pipeline.settings import current_store


def soon(seconds: float) -> datetime:
    return (datetime.now(UTC) + timedelta(seconds=seconds)).replace(microsecond=0)


def test_a_time_of_day_means_its_next_occurrence():
    """After the process started, so that a command that restarts itself keeps its deadline."""
    started = datetime.fromtimestamp(psutil.Process().create_time(), UTC).astimezone()
    for clock in ("00:00", "06:00", "23:59", f"{started:%H:%M}"):
        moment = Deadline().parse(clock)
        assert started < moment <= started + timedelta(days=1)
        assert f"{moment:%H:%M}" == clock


@pytest.mark.parametrize(
    "text", ["2031-01-02T03:04:05", "2031-01-02T03:04:05+02:00", "2031-01-02T03:04", "06:00"]
)
def test_a_serialized_moment_means_the_same_in_every_time_zone(text, monkeypatch):
    moment = Deadline().parse(text)
    monkeypatch.setenv("TZ", "Pacific/Auckland")
    time.tzset()
    assert Deadline().parse(Deadline().serialize(moment)) == moment
    monkeypatch.undo()
    time.tzset()


def test_an_empty_string_means_no_deadline():
    assert Deadline().parse("") is None
    assert Deadline().serialize(None) == ""


@pytest.mark.parametrize("text", ["six", "25:00", "06:00:99"])
def test_other_text_is_refused_with_an_example(text):
    with refuses(f"--until {text}", "06:00", kind=ParameterException):
        Deadline().parse(text)


def test_the_deadline_is_not_part_of_the_key():
    assert Act("succeed", until=soon(5)).action().key == Act("succeed").action().key


@pytest.mark.usefixtures("forked_builds")
def test_a_build_expected_to_end_after_the_deadline_does_not_start():
    record_cost(
        current_store(), "Act", CostSample(significant(Act("sleep_a_little")), Cost(3600.0, 1))
    )
    tasks = [Act("sleep_a_little", until=soon(60)), Act("succeed", until=soon(60))]
    record_cost(current_store(), "Act", CostSample(significant(Act("succeed")), Cost(1.0, 1)))
    assert not luigi.build(tasks, local_scheduler=True, log_level="WARNING")
    assert built() == ["Act succeed"]


def test_the_deadline_is_checked_after_the_build_has_its_cores(monkeypatch):
    """It may pass while the build waits for them."""
    limit = soon(3600)

    class Afterwards(datetime):
        """A clock that shows the deadline."""

        @classmethod
        def now(cls, tz=None):
            return limit.astimezone(tz)

    @contextlib.contextmanager
    def late(*_words):
        monkeypatch.setattr("pipeline.execution.deadline.datetime", Afterwards)
        yield CpuAllocation(1)

    monkeypatch.setattr("pipeline.execution.local_executor.cpu_for", late)
    assert not luigi.build([Act("succeed", until=limit)], local_scheduler=True)
    assert built() == []
    (attempt,) = attempts(current_store())
    assert attempt.kind == "late"


def test_after_the_deadline_nothing_starts_and_a_later_command_goes_on():
    words = ["Word", "--word", "hello"]
    status, screen = command(*words, "--until", "2020-01-01T06:00")
    assert status == 30
    (line,) = (line for line in screen.splitlines() if line.startswith(f"{Word('hello')}: "))
    assert mentions(line, "0 s", "2020-01-01")
    assert built() == []
    assert command(*words)[0] == 0
    assert command(*words, "--until", "2020-01-01T06:00")[0] == 0, "a made artifact needs none"
