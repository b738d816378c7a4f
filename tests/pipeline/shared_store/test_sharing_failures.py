"""A shared store that fails, goes away, or may only be read."""

import errno
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import luigi
import push_scenarios
import pytest
from commands import pipeline, start
from crash_scenarios import interruptions
from expected_failures import refuses
from killing import interrupted_at, killed, make
from message_words import mentions
from push_scenarios import ONE, PARTLY, THREE
from shared_stores import Place, read_only
from sharing_cases import build, command, flipped, is_whole
from store_toys import Sentence, Word, built

from pipeline.errors import StoreError
from pipeline.settings import current_store
from pipeline.shared_store.remote import Remote
from pipeline.task import artifact


def test_a_push_killed_anywhere_is_finished_by_the_next(shared, tmp_path):
    """SIGKILL at each point: over there an artifact is whole and recorded, or absent."""
    if shared.url.startswith("s3:"):  # where it takes its time: the object is there, no record is
        assert interrupted_at("push-object", ONE, tmp_path, killed)
    else:
        assert interruptions("killed", [PARTLY, THREE], tmp_path, push_scenarios.__file__) >= 40


def warnings(caplog) -> list[str]:
    return [
        r.getMessage() for r in caplog.records if r.name == "pipeline" and r.levelname == "WARNING"
    ]


@pytest.mark.usefixtures("inline", "_impatient")
@pytest.mark.parametrize("end", ["killed", "stopped"])
def test_a_server_that_goes_away_is_one_warning_and_the_work_goes_on(
    proxied, elsewhere, caplog, end
):
    _, proxy = proxied
    assert build(Word("hello"))
    there = elsewhere()
    assert Word("hello").complete()
    goes_on = threading.Event()
    if end == "stopped":  # it accepts connections, and answers none
        proxy.fault = lambda _method, _path: goes_on.wait() and None
    else:
        proxy.end()
    started = time.monotonic()
    assert build(Sentence()), "what was complete over there is built here"
    assert time.monotonic() - started < 15
    goes_on.set()
    assert sorted(built()) == ["Sentence", "Word hello", "Word hello", "Word world"]
    assert len(warnings(caplog)) == 1
    assert is_whole(there)


def test_a_directory_that_goes_away_is_one_warning_and_can_be_pushed_to_later(
    tmp_path, monkeypatch
):
    folder = tmp_path / "shared"
    folder.mkdir()
    monkeypatch.setenv("STYLETRF_REMOTE", str(folder))
    process = start("luigi", "--module", "toys", "Lasting")
    deadline = time.monotonic() + 30
    while built() != ["Lasting"]:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    folder.rename(tmp_path / "away")
    screen = "".join(process.communicate(timeout=60))
    assert process.returncode == 0, screen
    assert sum(mentions(line, folder) for line in screen.splitlines()) == 1
    assert "Traceback" not in screen
    (tmp_path / "away").rename(folder)
    assert "pushed" in pipeline("push")[1]


@pytest.mark.usefixtures("inline")
@pytest.mark.parametrize("url", ["s3://bucket/store", "missing", "gs://bucket/store"])
def test_an_unusable_shared_store_is_reported_quickly_and_once(
    tmp_path, monkeypatch, server, caplog, capsys, url
):
    url = url.replace("missing", str(tmp_path / "missing"))
    monkeypatch.setenv("STYLETRF_REMOTE", url)
    for name, value in server.environment(port=9).items():  # where nobody listens
        monkeypatch.setenv(name, value)
    started = time.monotonic()
    words = [Word(f"word{i}") for i in range(20)]
    assert not any(word.complete() for word in words)
    assert build(*words)
    assert time.monotonic() - started < 15
    assert 1 <= len(warnings(caplog)) <= 2
    assert mentions(warnings(caplog)[0], url)
    status, said = command(capsys, "push")
    assert (status, mentions(said, url), said.count("\n")) == (2, True, 1)


def test_a_missing_shared_store_is_reported(capsys):
    make(current_store(), "a")
    status, said = command(capsys, "push")
    assert (status, "STYLETRF_REMOTE" in said) == (2, True)


def cause_of(error: StoreError) -> str:
    """The type of what failed, whose own words the message has."""
    assert mentions(str(error), str(error.__cause__).rstrip("."))
    return type(error.__cause__).__name__


def test_a_missing_bucket_and_missing_credentials_have_different_messages(
    server, monkeypatch, tmp_path
):
    for name, value in server.environment().items():
        monkeypatch.setenv(name, value)
    with refuses("s3://nowhere/store") as error:
        Remote("s3://nowhere/store").read("actions/x.json")
    assert cause_of(error.value) == "FileNotFoundError"
    (tmp_path / "file").touch()
    with refuses("s3://nowhere/store") as error:
        Remote("s3://nowhere/store").create("actions/x.json", tmp_path / "file")
    assert cause_of(error.value) == "FileNotFoundError"
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("HOME", str(tmp_path))
    bucket = server.bucket().url
    with refuses(bucket) as error:
        Remote(bucket, '{"skip_instance_cache": true}').read("actions/x.json")
    assert cause_of(error.value) == "NoCredentialsError"


def test_without_the_extra_it_says_what_to_install():
    code = "import sys; sys.modules['s3fs'] = None; from pipeline.shared_store.remote import Remote"
    run = [sys.executable, "-c", f"{code}; Remote('s3://bucket/store').has('x')"]
    screen = subprocess.run(run, capture_output=True, text=True).stderr
    assert re.search(r"StoreError: .*s3fs.*pip install 'styletrf\[s3\]'", screen)


@pytest.mark.usefixtures("inline")
def test_throttling_and_server_errors_pass(proxied, elsewhere):
    place, proxy = proxied
    answers = iter([503, 500])

    def sometimes(_method: str, _path: str) -> int | None:
        return next(answers, None)

    proxy.fault = sometimes
    assert build(Word("hello"))
    assert len(place.names("actions")) == 1
    elsewhere()
    answers = iter([500, 503])
    assert artifact(Word("hello"))
    assert built() == ["Word hello"]
    assert next(answers, None) is None


@pytest.mark.usefixtures("inline")
def test_a_closure_of_which_a_record_cannot_be_read_is_refused(proxied, elsewhere, capsys):
    place, proxy = proxied
    assert build(Sentence())
    word, sentence = (task.action().key for task in (Word("hello"), Sentence()))
    elsewhere()
    proxy.fault = lambda _method, path: 503 if path.endswith(f"{word}.json") else None
    status, said = command(capsys, "pull", sentence, "--closure")
    assert (status, mentions(said, place.url)) == (2, True)


@pytest.mark.usefixtures("inline")
def test_a_server_that_errs_for_longer_is_waited_for_as_long_as_patience_lasts(
    proxied, monkeypatch, caplog
):
    place, proxy = proxied
    monkeypatch.setenv("STYLETRF_PATIENCE", "60")
    monkeypatch.setattr("pipeline.shared_store.remote._SECONDS_BETWEEN_TRIES", 0.1)
    answers = iter([500] * 4)  # the client itself makes three attempts
    proxy.fault = lambda _method, _path: next(answers, None)
    assert build(Word("hello"))
    assert next(answers, None) is None
    assert len(place.names("actions")) == 1
    (warning,) = warnings(caplog)
    assert mentions(warning, place.url, "60 s")


@pytest.mark.usefixtures("inline")
@pytest.mark.parametrize("what", ["forbidden", "no bucket"])
def test_what_will_not_pass_is_not_waited_for(proxied, monkeypatch, caplog, what):
    _, proxy = proxied
    monkeypatch.setenv("STYLETRF_PATIENCE", "60")
    if what == "forbidden":
        proxy.fault = lambda method, _path: 403 if method == "PUT" else None
    else:
        monkeypatch.setenv("STYLETRF_REMOTE", "s3://nowhere/store")
    begun = time.monotonic()
    assert build(Word("hello"))
    assert time.monotonic() - begun < 20
    assert not any(mentions(warning, "60 s") for warning in warnings(caplog))


@pytest.mark.usefixtures("inline")
def test_a_download_that_breaks_goes_on_where_it_broke(proxied, elsewhere):
    _, proxy = proxied
    breaks = 0

    def break_once(method: str, path: str) -> float | None:
        nonlocal breaks
        if method == "GET" and path.endswith(".tar") and breaks < 2:
            breaks += 1
            return 0.5
        return None

    assert build(Word("hello"))
    elsewhere()
    proxy.fault = break_once
    assert (artifact(Word("hello")) / "word.txt").read_text() == "hello"
    assert breaks == 2


@pytest.mark.usefixtures("inline")
def test_a_download_that_always_breaks_condemns_nothing(proxied, elsewhere):
    place, proxy = proxied
    assert build(Word("hello"))
    there = elsewhere()
    proxy.fault = lambda method, path: 0.5 if method == "GET" and path.endswith(".tar") else None
    assert build(Sentence())
    assert built().count("Word hello") == 2
    assert place.names("quarantine") == []
    assert is_whole(there)


@pytest.mark.usefixtures("inline")
def test_a_directory_that_may_only_be_read_serves_and_is_one_warning(monkeypatch, caplog):
    with tempfile.TemporaryDirectory() as folder:  # where anybody may go
        Path(folder).chmod(0o755)
        (Path(folder) / "shared").mkdir()
        for machine in ("here", "there"):
            (Path(folder) / machine).mkdir()
            os.chown(Path(folder) / machine, 65534 if os.getuid() == 0 else -1, -1)
        monkeypatch.setenv("STYLETRF_REMOTE", f"{folder}/shared")
        monkeypatch.setenv("STYLETRF_TOYS", f"{folder}/toys")
        (Path(folder) / "toys").mkdir(mode=0o777)
        (Path(folder) / "toys").chmod(0o777)
        monkeypatch.setenv("STYLETRF_STORE", f"{folder}/here")
        assert build(Word("hello"))
        monkeypatch.setenv("STYLETRF_STORE", f"{folder}/there")
        luigi.task_register.Register.clear_instance_cache()
        with read_only(Place(f"{folder}/shared")):
            assert build(Sentence())
        assert built().count("Word hello") == 1
        assert len(warnings(caplog)) == 1
        assert len(Place(f"{folder}/shared").names("actions")) == 1


@pytest.mark.usefixtures("inline")
def test_a_bucket_that_may_only_be_read_serves_and_is_one_warning(proxied, elsewhere, caplog):
    place, proxy = proxied
    assert build(Word("hello"))
    proxy.fault = lambda method, path: 403 if method in ("PUT", "POST", "DELETE") else None
    there = elsewhere()
    assert build(Sentence(("hello", "moon")), Sentence(("hello", "sun")))
    assert built().count("Word hello") == 1
    assert len(warnings(caplog)) == 1
    assert len(place.names("actions")) == 1
    proxy.fault = lambda method, path: None
    (name,) = place.names("objects")
    place.write(name, flipped(place.read(name), None))
    proxy.fault = lambda method, path: 403 if method in ("PUT", "POST", "DELETE") else None
    third = elsewhere("third")
    assert build(Sentence()), "wrong bytes that cannot be set aside are not believed either"
    assert built().count("Word hello") == 2
    assert is_whole(there)
    assert is_whole(third)


@pytest.mark.parametrize("name", ["EROFS", "ENOSPC", "EDQUOT", "ENOTDIR", "ENAMETOOLONG"])
def test_what_only_a_person_mends_is_not_waited_for(monkeypatch, name):
    def fail(_remote: Remote) -> None:
        raise StoreError("it fails") from OSError(getattr(errno, name), name)

    waits: list[float] = []
    monkeypatch.setattr("pipeline.shared_store.remote.time.sleep", waits.append)
    Remote("/shared", patience_seconds=0.001).call_or_none("writing", fail)
    assert not waits
