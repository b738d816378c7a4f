import contextlib
import errno
import io
import json
import os
import re
import signal
import subprocess
import sys
import tarfile
import tempfile
import time
from pathlib import Path

import luigi
import pytest
from killing import Gate, Scenario, ended, forked, kill_everywhere, make
from shared_stores import Place, Server, proxy_of, read_only
from store_toys import Sentence, Word, built
from test_command import start

from pipeline.__main__ import main
from pipeline.code_identity import kept
from pipeline.errors import StoreError
from pipeline.remote import Remote, open_remote
from pipeline.settings import current_remote, current_store
from pipeline.sharing import fetch, pull, push, recorded, shared_record
from pipeline.store import Store
from pipeline.task import StoredTask, artifact
from pipeline.verify import problems, records


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """Go on as another machine, with an empty store."""

    def go(name: str = "elsewhere") -> Store:
        monkeypatch.setenv("STYLETRF_STORE", str(tmp_path / name))
        luigi.task_register.Register.clear_instance_cache()
        open_remote.cache_clear()
        return current_store()

    return go


@pytest.fixture
def proxied(server: Server, monkeypatch):
    """A bucket behind a proxy that can fail."""
    with proxy_of(server) as proxy:
        for name, value in server.environment(proxy.port).items():
            monkeypatch.setenv(name, value)
        place = server.bucket()
        monkeypatch.setenv("STYLETRF_REMOTE", place.url)
        yield place, proxy


def build(*tasks: StoredTask) -> bool:
    return luigi.build(tasks, local_scheduler=True, logging_conf_file="")


def command(capsys, *arguments: str) -> tuple[int, list[dict[str, object]]]:
    """Status and rows of `python -m pipeline ... --json`."""
    capsys.readouterr()
    status = main([*arguments, "--json"])
    said = capsys.readouterr()
    return status, json.loads(said.out) if status < 2 else said.err


def objects(store: Store) -> list[str]:
    return sorted(path.name for path in (store.root / "objects").glob("*/*"))


def is_whole(store: Store) -> bool:
    return not list(problems(store, deep=True))


# A run.


@pytest.mark.usefixtures("inline")
def test_another_machine_builds_nothing_and_fetches_only_what_it_reads(shared, elsewhere):
    assert build(Sentence())
    assert len(shared.names("objects")) == len(shared.names("actions")) == 3
    before, here = built(), artifact(Sentence())
    there = elsewhere()
    assert Sentence().complete()
    assert build(Sentence())
    assert built() == before
    assert objects(there) == [], "complete without the bytes"
    fetched = artifact(Sentence())
    assert fetched.is_relative_to(there.root)
    assert (fetched / "sentence.txt").read_text() == "hello world"
    assert fetched.name == here.name
    assert len(objects(there)) == 1
    assert build(Sentence(("hello", "moon")))
    assert sorted(set(built()) - set(before)) == ["Word moon"]
    assert built().count("Word hello") == 1, "its object was fetched for the new sentence"
    assert is_whole(there)


@pytest.mark.usefixtures("inline")
def test_another_machine_is_told_which_function_differs(shared, elsewhere):
    build(Word("hello"))
    (code,) = shared.names("code")
    record = Word("hello").record()
    members = kept(str(record.provenance["closure"]), current_store())
    there = elsewhere()
    assert Word("hello").complete()
    assert members
    assert kept(str(record.provenance["closure"]), there) == members
    assert Path(code).stem == record.provenance["closure"]


@pytest.mark.usefixtures("inline")
def test_shared_code_that_is_garbage_is_passed_over(shared, elsewhere):
    build(Word("hello"))
    closure = str(Word("hello").record().provenance["closure"])
    shared.write(f"code/{closure[:2]}/{closure}.json", b'{"a": "b"}')
    there = elsewhere()
    assert Word("hello").complete()
    assert kept(closure, there) is None


@pytest.mark.parametrize("workers", ["1", "2"])
def test_the_command_itself_shares(shared, elsewhere, workers):
    def run() -> str:
        process = start("luigi", "--module", "store_toys", "Sentence", "--workers", workers)
        screen = "".join(process.communicate(timeout=60))
        assert process.returncode == 0, screen
        return screen

    assert "Sentence: done" in run()
    elsewhere()
    screen = run()
    assert "Did not run any tasks" in screen
    assert screen.index("=====") < 3, "and nothing to say about it"
    assert len(built()) == 3


@pytest.mark.usefixtures("inline")
def test_what_was_collected_here_is_fetched_again(shared, store):
    build(Word("hello"), Word("world"))
    store.quarantine(artifact(Word("hello")))
    luigi.task_register.Register.clear_instance_cache()
    assert Word("hello").complete()
    assert is_whole(store), "an object that the shared store has is not missing"
    assert build(Sentence())
    assert built().count("Word hello") == 1


# The commands.


@pytest.fixture
def _impatient(monkeypatch):
    """A second for each request, instead of five."""
    client = {"read_timeout": 1, "retries": {"mode": "standard", "total_max_attempts": 3}}
    config = luigi.configuration.get_config()
    config.set("store", "remote_options", json.dumps({"config_kwargs": client}))
    yield
    config.remove_option("store", "remote_options")


@pytest.fixture
def _unshared(monkeypatch):
    """Builds that upload nothing."""
    config = luigi.configuration.get_config()
    config.set("store", "push", "false")
    yield
    config.remove_option("store", "push")


@pytest.mark.usefixtures("inline", "_unshared")
def test_push_and_pull_round_trip(shared, elsewhere, capsys):
    build(Sentence())
    here = current_store()
    assert shared.names() == []
    status, rows = command(capsys, "push")
    assert (status, {row["done"] for row in rows}) == (0, {"pushed"})
    assert sorted(row["label"] for row in rows) == ["Sentence", "Word hello", "Word world"]
    assert command(capsys, "push") == (0, [])
    key = Sentence().action().key
    shared.remove(f"actions/{key[:2]}/{key}.json")
    status, rows = command(capsys, "push")
    assert (status, [row["label"] for row in rows]) == (0, ["Sentence"]), "only what lacks"
    there = elsewhere()
    status, rows = command(capsys, "pull", key[:12])
    assert (status, [row["done"] for row in rows]) == (0, ["fetched"])
    assert len(objects(there)) == 1
    status, rows = command(capsys, "pull", objects(there)[0][:9], "--closure")
    assert (status, sorted(row["label"] for row in rows)) == (0, ["Word hello", "Word world"])
    assert objects(there) == objects(here)
    assert [r.to_json() for r in records(there)] == [r.to_json() for r in records(here)]
    assert command(capsys, "pull", key, "--closure") == (0, [])
    assert command(capsys, "pull", "xyz")[0] == 2
    assert is_whole(there)


@pytest.mark.usefixtures("_unshared")
def test_push_of_what_is_damaged_is_refused(shared, store, capsys):
    record = make(store, "a", "text")
    file = store.object(record.output.digest) / "deep" / "0"
    file.chmod(0o644)
    file.write_text("tixt")
    status, rows = command(capsys, "push")
    assert (status, rows[0]["done"]) == (1, "is missing or damaged here")
    assert shared.names() == []


def test_the_archive_of_equal_content_is_equal(shared, store, tmp_path):
    push(store, make(store, "a", "same"), current_remote())
    (name,) = shared.names("objects")
    first = shared.read(name)
    other = Store.open(tmp_path / "other")
    record = make(other, "b", "same")
    os.utime(other.object(record.output.digest) / "deep" / "0", (1, 1))
    shared.remove(name)
    push(other, record, current_remote())
    assert shared.read(name) == first


# Two at a time.


@pytest.mark.parametrize("content", ["same", "another"])
def test_of_two_pushers_one_gives_the_record(shared, store, tmp_path, content):
    """Both found nothing there, and upload at once; the slower replaces nothing."""
    other = Store.open(tmp_path / "other")
    mine, theirs = make(store, "a", "same"), make(other, "a", content)
    ready, go = [Gate(), Gate()], Gate()

    def run(root: Path, gate: Gate) -> None:
        def reached(point: str) -> None:
            if point == "push-packed":
                gate.open()
                assert go.wait()

        push(Store(root, reached), mine if root == store.root else theirs, current_remote())

    children = [
        forked(lambda root=root, gate=gate: run(root, gate))
        for root, gate in zip((store.root, other.root), ready, strict=True)
    ]
    assert all(gate.wait() for gate in ready)
    go.open()
    assert [ended(child) for child in children] == [0, 0]
    assert len(shared.names("actions")) == 1
    assert len(shared.names("objects")) == len({mine.output, theirs.output})
    winner = shared_record(current_remote(), mine.action.key)
    assert winner in (mine, theirs)
    reader = Store.open(tmp_path / "reader")
    assert recorded(reader, mine.action.key) == winner
    assert pull(reader, winner, current_remote()) == "fetched"
    assert is_whole(reader)


def test_of_many_readers_one_downloads_and_none_takes_that_for_a_loss(
    shared, store, tmp_path, monkeypatch
):
    record = make(store, "a", "text")
    push(store, record, current_remote())
    there, download = Store.open(tmp_path / "there"), Remote.download

    def slowly(remote: Remote, name: str, target: Path) -> None:
        (tmp_path / f"downloaded.{os.getpid()}").touch()
        time.sleep(0.3)
        download(remote, name, target)

    monkeypatch.setattr(Remote, "download", slowly)

    def read() -> None:
        assert fetch(Store(there.root), record)

    assert [ended(child) for child in [forked(read) for _ in range(4)]] == [0] * 4
    assert len(list(tmp_path.glob("downloaded.*"))) == 1
    assert not list((there.root / "quarantine").iterdir())


def test_what_another_fetched_meanwhile_is_no_loss(shared, store, tmp_path, monkeypatch):
    record = make(store, "a", "text")
    push(store, record, current_remote())
    there = Store.open(tmp_path / "there")

    def slower(*arguments) -> str:
        pull(*arguments)
        return pull(*arguments)

    monkeypatch.setattr("pipeline.sharing.pull", slower)
    assert fetch(there, record)
    assert not list((there.root / "quarantine").iterdir())


@pytest.mark.parametrize("full", ["download", "unpack"])
def test_our_own_full_disk_is_not_the_shared_stores_failure(
    shared, store, tmp_path, monkeypatch, caplog, full
):
    record = make(store, "a", "text")
    push(store, record, current_remote())
    there, download = Store.open(tmp_path / "there"), Remote.download
    if full == "download":
        to_full = lambda remote, name, target: download(remote, name, Path("/dev/full"))  # noqa: E731
        monkeypatch.setattr(Remote, "download", to_full)
    else:
        failing = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        monkeypatch.setattr("pipeline.sharing.unpack", lambda *_arguments: raising(failing))
    with pytest.raises(OSError, match="No space left") as failure:
        fetch(there, record)
    assert failure.value.errno == errno.ENOSPC
    assert not list((there.root / "quarantine").iterdir())
    assert not caplog.messages


def raising(error: Exception) -> None:
    raise error


def test_a_failure_is_told_in_sentences(caplog):
    def fail(_remote: Remote) -> None:
        raise StoreError("it is away")

    Remote("/nowhere").attempt("reading", fail)
    assert caplog.messages == ["it is away. Going on without reading there for a minute."]


@pytest.mark.parametrize(
    ("shared", "size"),
    [("directory", 10), ("s3", 10), pytest.param("s3", 120_000_000, id="s3 in parts")],
    indirect=["shared"],
)
def test_what_is_there_is_never_replaced(shared, tmp_path, size):
    first, second = tmp_path / "first", tmp_path / "second"
    for path, letter in ((first, b"a"), (second, b"b")):
        with path.open("wb") as file:
            file.write(letter)
            file.truncate(size)
    remote = current_remote()
    assert remote.create("objects/x.tar", first)
    assert not remote.create("objects/x.tar", second)
    remote.download("objects/x.tar", tmp_path / "back")
    assert (tmp_path / "back").read_bytes() == first.read_bytes()


# What cannot be believed.


def flipped(content: bytes, record) -> bytes:
    return content.replace(b"hello", b"jello")


def cut(content: bytes, record) -> bytes:
    return content[: content.index(b"hello") + 2]


def tar_of(*members: tuple[str, bytes, bytes]) -> bytes:
    """A tar of names, types and contents (or where a link leads)."""
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as tar:
        for name, kind, content in members:
            member = tarfile.TarInfo(name)
            member.type = kind
            member.linkname = content.decode() if kind in (tarfile.SYMTYPE, tarfile.LNKTYPE) else ""
            member.size = len(content) if kind == tarfile.REGTYPE else 0
            tar.addfile(member, io.BytesIO(content))
    return stream.getvalue()


FILE = tarfile.REGTYPE
WRONG = {
    "flipped": flipped,
    "cut": cut,
    "empty": lambda content, record: b"",
    "garbage": lambda content, record: b"\xff" * len(content),
    "another artifact": lambda content, record: tar_of(("word.txt", FILE, b"other")),
    "an extra file": lambda content, record: tar_of(
        ("extra", FILE, b""), ("word.txt", FILE, b"hello")
    ),
    "an extra folder": lambda content, record: tar_of(
        ("extra", tarfile.DIRTYPE, b""), ("word.txt", FILE, b"hello")
    ),
    "twice": lambda content, record: tar_of(("word.txt", FILE, b"he"), ("word.txt", FILE, b"llo")),
    "upwards": lambda content, record: tar_of(("../../../escaped", FILE, b"hello")),
    "absolute": lambda content, record: tar_of(("/tmp/escaped", FILE, b"hello")),
    "a link": lambda content, record: tar_of(
        ("word.txt", FILE, b"hello"), ("link", tarfile.SYMTYPE, b"/etc/passwd")
    ),
    "a hard link": lambda content, record: tar_of(
        ("word.txt", FILE, b"hello"), ("link", tarfile.LNKTYPE, b"word.txt")
    ),
    "through a link": lambda content, record: tar_of(
        ("d", tarfile.SYMTYPE, b"/tmp"), ("d/escaped", FILE, b"hello")
    ),
    "a device": lambda content, record: tar_of(
        ("word.txt", FILE, b"hello"), ("null", tarfile.CHRTYPE, b"")
    ),
    "no folder": lambda content, record: tar_of(("deep/word.txt", FILE, b"hello")),
}


@pytest.mark.usefixtures("inline")
@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_bytes_are_rejected_set_aside_and_built_anew(shared, elsewhere, wrong, tmp_path):
    build(Word("hello"))
    (name,) = shared.names("objects")
    good = shared.read(name)
    shared.write(name, WRONG[wrong](good, None))
    there = elsewhere()
    (record,) = (shared_record(current_remote(), Path(n).stem) for n in shared.names("actions"))
    assert pull(there, record, current_remote()) == "is wrong there"
    assert objects(there) == []
    assert not Path("/tmp/escaped").exists()
    assert not list(tmp_path.rglob("escaped"))
    assert list((there.root / "tmp").iterdir()) == []
    assert shared.names("objects") == []
    assert len(shared.names("quarantine")) == 1
    assert not Word("hello").complete(), "a record without its object is none"
    assert build(Sentence())
    assert built().count("Word hello") == 2
    assert is_whole(there)
    assert good in [shared.read(n) for n in shared.names("objects")], "and given back"


@pytest.mark.usefixtures("inline")
def test_a_record_without_its_object_counts_as_absent(shared, elsewhere):
    build(Word("hello"))
    shared.remove(*shared.names("objects"))
    elsewhere()
    assert not Word("hello").complete()
    assert build(Word("hello"))
    assert built() == ["Word hello"] * 2
    elsewhere("third")
    assert Word("hello").complete(), "the second pusher made it whole"


@pytest.mark.usefixtures("inline")
@pytest.mark.parametrize(
    "garble",
    [
        lambda text: b"",
        lambda text: text[:50],
        lambda text: text.replace(b'"Word"', b'"Ward"'),
        lambda text: text.replace(b'"format": 2', b'"format": 3'),
    ],
)
def test_a_record_that_is_none_counts_as_absent_and_is_replaced(shared, elsewhere, garble):
    build(Word("hello"))
    (name,) = shared.names("actions")
    shared.write(name, garble(shared.read(name)))
    elsewhere()
    assert build(Word("hello"))
    assert built() == ["Word hello"] * 2
    elsewhere("third")
    assert Word("hello").complete()


# What fails.


def test_a_push_killed_anywhere_is_finished_by_the_next(shared, tmp_path):
    """SIGKILL at each point: over there an artifact is whole and recorded, or absent."""
    is_s3 = shared.url.startswith("s3:")

    def part(store: Store) -> Remote:
        """The store's own part of the shared store."""
        remote = Remote(f"{shared.url}/{store.root.name}", reached=store.reached)
        with contextlib.suppress(OSError):
            Path(remote.url).mkdir()
        return remote

    def give(store: Store) -> None:
        for record in records(store):
            push(store, record, part(store))

    def is_believable(store: Store) -> None:
        remote = part(store)
        reader = Store.open(tmp_path / f"{store.root.name}-reader")
        for record in records(store):
            if found := shared_record(remote, record.action.key):
                assert found == record
                assert pull(reader, found, remote) in ("fetched", "is here")
        assert not list(problems(reader, deep=True))

    def is_complete(store: Store) -> None:
        assert all(shared_record(part(store), record.action.key) for record in records(store))

    def three(store: Store) -> None:
        make(store, "a")
        make(store, "b", "same", files=40)
        make(store, "c", "same", files=40)

    def partly(store: Store) -> None:
        three(store)
        push(store, next(records(store)), part(store))
        there = Place(part(store).url)
        there.remove(*there.names("objects"))

    situations = {"partly": partly} | ({} if is_s3 else {"three": three})  # S3 takes its time
    kills = sum(
        kill_everywhere(Scenario(name, give, prepare, is_believable, is_complete), tmp_path)
        for name, prepare in situations.items()
    )
    assert kills >= (10 if is_s3 else 40)


def warnings(caplog) -> list[str]:
    return [
        r.getMessage() for r in caplog.records if r.name == "pipeline" and r.levelname == "WARNING"
    ]


@pytest.mark.usefixtures("inline", "_impatient")
@pytest.mark.parametrize("end", ["killed", "stopped"])
def test_a_server_that_goes_away_is_one_warning_and_the_work_goes_on(
    monkeypatch, elsewhere, caplog, end
):
    server = Server()
    for name, value in server.environment().items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("STYLETRF_REMOTE", server.bucket().url)
    try:
        assert build(Word("hello"))
        there = elsewhere()
        assert Word("hello").complete()
        if end == "stopped":  # it accepts connections, and answers none
            server.send(signal.SIGSTOP)
        else:
            server.kill()
        started = time.monotonic()
        assert build(Sentence()), "what was complete over there is built here"
        assert time.monotonic() - started < 15
        assert sorted(built()) == ["Sentence", "Word hello", "Word hello", "Word world"]
        assert len(warnings(caplog)) == 1
        assert is_whole(there)
    finally:
        server.kill()


def test_a_directory_that_goes_away_while_a_command_runs(tmp_path, monkeypatch):
    folder = tmp_path / "shared"
    folder.mkdir()
    monkeypatch.setenv("STYLETRF_REMOTE", str(folder))
    process = start("luigi", "--module", "store_toys", "Lasting")
    deadline = time.monotonic() + 30
    while built() != ["Lasting"]:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    folder.rename(tmp_path / "away")
    screen = "".join(process.communicate(timeout=60))
    assert process.returncode == 0, screen
    assert "there is no such folder" in screen
    assert "Traceback" not in screen
    (tmp_path / "away").rename(folder)
    process = start("pipeline", "push")
    assert "pushed" in process.communicate(timeout=60)[0]


@pytest.mark.usefixtures("inline")
@pytest.mark.parametrize("url", ["s3://bucket/store", "missing", "gs://bucket/store"])
def test_a_shared_store_that_is_none_is_told_quickly_and_once(
    tmp_path, monkeypatch, server, caplog, capsys, url
):
    monkeypatch.setenv("STYLETRF_REMOTE", url.replace("missing", str(tmp_path / "missing")))
    for name, value in server.environment(port=9).items():  # where nobody listens
        monkeypatch.setenv(name, value)
    started = time.monotonic()
    words = [Word(f"word{i}") for i in range(20)]
    assert not any(word.complete() for word in words)
    assert build(*words)
    assert time.monotonic() - started < 15
    assert 1 <= len(warnings(caplog)) <= 2
    assert "the shared store" in warnings(caplog)[0]
    status, said = command(capsys, "push")
    assert (status, "the shared store" in said, said.count("\n")) == (2, True, 1)


def test_no_shared_store_at_all_is_told(capsys):
    make(current_store(), "a")
    status, said = command(capsys, "push")
    assert (status, "STYLETRF_REMOTE" in said) == (2, True)


def test_a_missing_bucket_and_missing_credentials_are_told_apart(server, monkeypatch, tmp_path):
    for name, value in server.environment().items():
        monkeypatch.setenv(name, value)
    with pytest.raises(StoreError, match="bucket does not exist"):
        Remote("s3://nowhere/store").read("actions/x.json")
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="bucket does not exist"):
        Remote("s3://nowhere/store").create("actions/x.json", tmp_path / "file")
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("HOME", str(tmp_path))
    bucket = server.bucket().url
    with pytest.raises(StoreError, match="credentials"):
        Remote(bucket, '{"skip_instance_cache": true}').read("actions/x.json")


def test_without_the_extra_it_says_what_to_install():
    code = "import sys; sys.modules['s3fs'] = None; from pipeline.remote import Remote"
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
