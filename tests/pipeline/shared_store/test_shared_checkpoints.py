"""Checkpoints travel through a shared store: a directory, and a bucket of a real S3 server."""

import errno
import os
import threading
import time
from pathlib import Path

import luigi
import pytest
from checkpoint_cases import KEY, failing, folder, uploaded
from message_words import mentions
from shared_stores import Place

from pipeline.errors import StoreError
from pipeline.shared_store import checkpoints
from pipeline.shared_store.checkpoints import forget_checkpoints, shared_checkpoints
from pipeline.shared_store.settings import current_remote

NOTES = {".shared"}
"""What lies beside downloaded checkpoints and belongs to none of them."""


def test_another_machine_goes_on_from_the_last_one(shared: Place, tmp_path):
    here = folder(tmp_path / "here", checkpoint="step 1")
    with failing(here):
        (here / "new").write_text("step 2")
        (here / "new").replace(here / "checkpoint")
        (here / ".seconds").write_text("12.5")
    assert len(uploaded()) == 1
    there = folder(tmp_path / "there")
    with shared_checkpoints(KEY, there):
        assert (there / "checkpoint").read_text() == "step 2"
        assert (there / ".seconds").read_text() == "12.5", "and what was spent until then counts"
    assert len(uploaded()) == 1, "what succeeds leaves no more"
    forget_checkpoints(KEY)
    assert uploaded() == []
    assert sorted(p.name for p in tmp_path.iterdir() if p.name[:4] in ("here", "ther")) == [
        "here", "there",
    ]  # fmt: skip


@pytest.mark.parametrize("age_s", [-60, 60])
def test_the_newer_one_counts_wherever_it_was_made(shared: Place, tmp_path, age_s):
    """A machine that comes back has one that others have long gone on from."""
    with failing(folder(tmp_path / "here", checkpoint="shared")):
        pass
    own = folder(tmp_path / "own", checkpoint="own")
    then = time.time() - age_s
    os.utime(own / "checkpoint", (then, then))
    with shared_checkpoints(KEY, own):
        assert (own / "checkpoint").read_text() == ("own" if age_s < 0 else "shared")


def test_an_older_one_takes_nothing_away(shared: Place, tmp_path):
    """Two machines at one key, as without locks: the slower one uploads last."""
    with failing(folder(tmp_path / "here", checkpoint="far")):
        pass
    slow = folder(tmp_path / "slow", checkpoint="near")
    uploader = checkpoints.CheckpointUploader(KEY, slow, current_remote())
    os.utime(slow / "checkpoint", (1e9, 1e9))
    uploader.upload()
    there = folder(tmp_path / "there")
    for _ in range(2):  # what was brought may be uploaded again
        with failing(there):
            assert (there / "checkpoint").read_text() == "far"


def test_what_is_half_written_is_not_given(shared: Place, tmp_path):
    here = folder(tmp_path / "here", checkpoint="step 1")
    (here / ".checkpoint.12.partial.safetensors").write_text("half")
    with failing(here):
        pass
    there = folder(tmp_path / "there")
    with shared_checkpoints(KEY, there):
        assert {path.name for path in there.iterdir()} - NOTES == {"checkpoint"}


def test_what_a_killed_process_left_does_not_stop_checkpoints(shared: Place, tmp_path):
    """A folder that it had unpacked made the next build begin at its start."""
    here = folder(tmp_path / "here", checkpoint="step 1")
    there = folder(tmp_path / "there")
    for name in ("here.still", "there.new"):
        folder(tmp_path / name, left="over")
    for name in ("here.tar", "there.tar"):
        (tmp_path / name).write_bytes(b"half")
    with failing(here):
        pass
    with shared_checkpoints(KEY, there):
        assert {path.name for path in there.iterdir()} - NOTES == {"checkpoint"}


def test_a_checkpoint_that_the_disk_refuses_is_a_warning(
    shared: Place, tmp_path, monkeypatch, caplog
):
    with failing(folder(tmp_path / "here", checkpoint="step 1")):
        pass

    def full(*_words: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(checkpoints, "unpack", full)
    with shared_checkpoints(KEY, folder(tmp_path / "there")):
        pass
    (message,) = caplog.messages
    assert os.strerror(errno.ENOSPC) in message
    assert mentions(message, current_remote().url)


def test_checkpoints_are_uploaded_while_a_build_runs(shared: Place, tmp_path, monkeypatch):
    """A machine that is lost has no end."""
    monkeypatch.setattr("pipeline.shared_store.checkpoints.number_setting", lambda *_name: 0.1)
    here, seen = folder(tmp_path / "here"), threading.Event()
    with shared_checkpoints(KEY, here):
        assert not uploaded()
        (here / "checkpoint").write_text("step 1")
        deadline = time.monotonic() + 20
        while not uploaded() and time.monotonic() < deadline:
            seen.wait(0.05)
        assert uploaded()


@pytest.mark.parametrize(("word", "count"), [("True", 1), ("yes", 1), ("No", 0), ("false", 0)])
def test_push_has_the_words_of_configparser(shared: Place, tmp_path, word, count):
    """`push = True` meant false, and nothing was shared."""
    config = luigi.configuration.get_config()
    config.set("store", "push", word)
    try:
        with failing(folder(tmp_path / "here", checkpoint="step 1")):
            pass
    finally:
        config.remove_option("store", "push")
    assert len(uploaded()) == count


@pytest.mark.parametrize("damage", [b"", b"garbage", None])
def test_a_damaged_one_is_not_believed(shared: Place, tmp_path, damage, caplog):
    with failing(folder(tmp_path / "here", checkpoint="x" * 1000)):
        pass
    (name,) = uploaded()
    remote, bad = current_remote(), tmp_path / "bad"
    if damage is None:
        remote.download(f"resume/{KEY}/{name}", bad)
        damage = bad.read_bytes().replace(b"xxx", b"xyx", 1)
    bad.write_bytes(damage)
    remote.remove(f"resume/{KEY}/{name}")
    assert remote.create(f"resume/{KEY}/{name}", bad)
    there = folder(tmp_path / "there")
    with shared_checkpoints(KEY, there):
        assert not list(there.iterdir())


def test_without_a_shared_store_nothing_happens(tmp_path):
    here = folder(tmp_path / "here", checkpoint="step 1")
    with shared_checkpoints(KEY, here):
        pass
    forget_checkpoints(KEY)
    assert [path.name for path in here.iterdir()] == ["checkpoint"]


def test_a_shared_store_that_is_away_is_a_warning(tmp_path, monkeypatch, caplog):
    monkeypatch.setenv("STYLETRF_REMOTE", str(tmp_path / "nowhere"))
    with failing(folder(tmp_path / "here", checkpoint="step 1")):
        pass
    assert caplog.messages
    assert all(mentions(message, tmp_path / "nowhere") for message in caplog.messages)


def written(resume: Path, text: str, ahead_s: float = 0.0) -> None:
    """Writes a checkpoint on a machine whose clock is ahead by so much."""
    (resume / "new").write_text(text)
    os.utime(resume / "new", (time.time() + ahead_s,) * 2)
    (resume / "new").replace(resume / "checkpoint")


@pytest.mark.parametrize("is_uploaded", [True, False])
def test_what_continues_a_checkpoint_is_newer_whatever_the_clocks_say(
    shared: Place, tmp_path, is_uploaded
):
    """The old one of a machine whose clock was ahead replaced the work of another one."""
    ahead, here, third = (folder(tmp_path / name) for name in ("ahead", "here", "third"))
    with failing(ahead):
        written(ahead, "step 1", ahead_s=600)
    for step in (2, 3):
        if is_uploaded:
            with failing(here):
                written(here, f"step {step}")
        else:  # it is killed before
            with shared_checkpoints(KEY, here):
                written(here, f"step {step}")
        with shared_checkpoints(KEY, here):
            assert (here / "checkpoint").read_text() == f"step {step}"
    with shared_checkpoints(KEY, third):
        assert (third / "checkpoint").read_text() == ("step 3" if is_uploaded else "step 1")
    assert len(uploaded()) == 1


def test_a_checkpoint_whose_upload_failed_is_uploaded_by_the_next_one(
    shared: Place, tmp_path, monkeypatch
):
    monkeypatch.setattr("pipeline.shared_store.remote.CIRCUIT_OPEN_S", 0.0)
    here, remote = folder(tmp_path / "here", checkpoint="step 1"), current_remote()
    uploader = checkpoints.CheckpointUploader(KEY, here, remote)

    def away(*_request: object) -> None:
        raise StoreError("it is away")

    with monkeypatch.context() as outage:
        outage.setattr(type(remote), "create", away)
        uploader.upload()
    assert not uploaded()
    uploader.upload()
    assert uploaded()
