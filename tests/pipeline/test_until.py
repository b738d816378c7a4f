"""Nothing is begun that would not end in time."""

import contextlib
import time
from datetime import UTC, datetime, timedelta

import luigi
import psutil
import pytest
from build_toys import Act
from luigi.parameter import ParameterException
from store_toys import built
from test_command import luigi as command

from pipeline.attempts import attempts
from pipeline.costs import Cost, Spent, note
from pipeline.host import Share
from pipeline.resources import significant
from pipeline.settings import current_store
from pipeline.until import NOT_BEGUN, Until


def soon(seconds: float) -> datetime:
    return (datetime.now(UTC) + timedelta(seconds=seconds)).replace(microsecond=0)


def test_a_time_of_day_is_the_next_one():
    """After the process began: a command that runs again is to end when it was told at first."""
    begun = datetime.fromtimestamp(psutil.Process().create_time(), UTC).astimezone()
    for clock in ("00:00", "06:00", "23:59", f"{begun:%H:%M}"):
        moment = Until().parse(clock)
        assert begun < moment <= begun + timedelta(days=1)
        assert f"{moment:%H:%M}" == clock


@pytest.mark.parametrize("told", ["2031-01-02T03:04:05", "2031-01-02T03:04:05+02:00", "06:00"])
def test_a_moment_means_the_same_wherever_it_is_read(told, monkeypatch):
    moment = Until().parse(told)
    monkeypatch.setenv("TZ", "Pacific/Auckland")
    time.tzset()
    assert Until().parse(Until().serialize(moment)) == moment
    monkeypatch.undo()
    time.tzset()


def test_no_limit_is_told_by_no_word():
    assert Until().parse("") is None
    assert Until().serialize(None) == ""


@pytest.mark.parametrize("told", ["six", "25:00", "06:00:99"])
def test_what_is_no_time_is_refused_with_what_to_give(told):
    with pytest.raises(ParameterException, match="such as 06:00"):
        Until().parse(told)


def test_it_is_no_part_of_what_a_task_is():
    assert Act("succeed", until=soon(5)).action().key == Act("succeed").action().key


def test_what_is_known_to_take_longer_is_not_begun():
    note(current_store(), "Act", Spent(significant(Act("sleep_a_little")), Cost(3600.0, 1)))
    tasks = [Act("sleep_a_little", until=soon(60)), Act("succeed", until=soon(60))]
    note(current_store(), "Act", Spent(significant(Act("succeed")), Cost(1.0, 1)))
    assert not luigi.build(tasks, local_scheduler=True, log_level="WARNING")
    assert built() == ["Act succeed"]


def test_the_time_is_looked_at_when_nothing_more_is_waited_for(monkeypatch):
    """What would have ended in time when it began to wait for a core may not any more."""
    limit = soon(4)

    @contextlib.contextmanager
    def late(*_words):
        time.sleep(5)
        yield Share(1)

    monkeypatch.setattr("pipeline.building.share_for", late)
    assert not luigi.build([Act("succeed", until=limit)], local_scheduler=True)
    assert built() == []
    (attempt,) = attempts(current_store())
    assert attempt.end.startswith(NOT_BEGUN)


def test_after_the_hour_nothing_begins_and_the_same_command_goes_on_later():
    words = ["Word", "--word", "hello"]
    status, screen = command(*words, "--until", "2020-01-01T06:00")
    assert status == 30
    assert "Word(word=hello, loudness=1.0): not begun: 0 s are left until 2020-01-01" in screen
    assert "Run the same command again to go on." in screen
    assert built() == []
    assert command(*words)[0] == 0
    assert command(*words, "--until", "2020-01-01T06:00")[0] == 0, "what is there needs no time"
