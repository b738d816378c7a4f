"""Folders of several machines and users that show artifacts of one store."""

import json
import os
import shutil
import socket
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest
from collection_cases import made, names
from expected_failures import refuses

from pipeline.digest import typed_digest
from pipeline.maintenance.garbage_collection import collect
from pipeline.maintenance.roots import add_folder_root, roots, unpin
from pipeline.store import Store

collect_all = partial(collect, keep_last=0, grace_hours=0, delete=True)
NOBODY = 65534


@pytest.fixture
def on_host(monkeypatch) -> Callable[[str], None]:
    """Goes on as another machine, on which the store has the same path."""
    return lambda name: monkeypatch.setattr(socket, "gethostname", lambda: name)


def shown(store: Store, folder: Path, name: str, top: Path | None = None) -> Path:
    """A folder that shows a new artifact."""
    target = store.object(made(store, name).output.digest)
    folder.mkdir(exist_ok=True, parents=True)
    add_folder_root(store, folder, [target], top)
    (folder / name).symlink_to(target)
    return folder


def test_what_a_folder_of_another_host_shows_stays_though_there_is_no_such_folder_here(
    store, tmp_path, on_host
):
    """Numbers of file systems are equal on different hosts."""
    on_host("there")
    out = shown(store, tmp_path / "out", "a")
    on_host("here")
    (out / "a").unlink()
    out.rmdir()
    reasons = {decision.why for decision in collect_all(store) if not decision.delete}
    assert names(store) == ["a"]
    assert reasons == {"shown on there"}
    on_host("there")
    collect_all(store)
    assert names(store) == [], "its own host sees that it is gone"


def test_folders_of_one_path_on_two_hosts_keep_what_each_shows(store, tmp_path, on_host):
    on_host("there")
    shown(store, tmp_path / "out", "a")
    (tmp_path / "out" / "a").unlink()
    on_host("here")
    shown(store, tmp_path / "out", "b")
    collect_all(store)
    assert names(store) == ["a", "b"]


@pytest.mark.parametrize("ended", ["out", "", "/"])
def test_roots_of_a_host_that_is_gone_end_by_unpin_with_those_of_inner_folders(
    store, tmp_path, on_host, ended
):
    on_host("gone")
    for folder in (tmp_path / "out", tmp_path / "out" / "scene"):
        shown(store, folder, folder.name)
    on_host("there")
    shown(store, tmp_path / "other", "other")
    on_host("here")
    with refuses("gone"):
        unpin(store, "gone")
    unpin(store, f"gone:{tmp_path / ended if ended == 'out' else ended}")
    collect_all(store)
    assert names(store) == ["other"]


def test_unpin_of_a_folder_ends_the_root_of_this_host_alone(store, tmp_path, on_host):
    for host in ("there", "here"):
        on_host(host)
        shown(store, tmp_path / "out", host)
    unpin(store, str(tmp_path / "out"))
    collect_all(store)
    assert names(store) == ["there"]


@pytest.fixture
def shared(store, tmp_path, on_host) -> Path:
    """The folder `out/scene` of another host, which shows `a`; goes on here."""
    on_host("there")
    shown(store, tmp_path / "out/scene", "a", tmp_path / "out")
    on_host("here")
    return tmp_path / "out/scene"


@pytest.mark.parametrize("is_published_here", [False, True])
@pytest.mark.parametrize("is_removed", [False, True])
def test_a_shared_folder_keeps_what_it_shows_whichever_host_put_it_there(
    store, shared, is_published_here, is_removed
):
    """A container has a new name whenever it is created, and nothing was ever freed."""
    collect_all(store)
    assert names(store) == ["a"]
    (shared / "a").unlink()
    if is_published_here:
        shown(store, shared, "b", shared.parent)
        collect_all(store)
        assert names(store) == ["b"]
        (shared / "b").unlink()
    if is_removed:
        shared.rmdir()
    collect_all(store)
    assert names(store) == []


def test_unpin_of_a_shared_folder_ends_the_roots_of_all_its_hosts(store, shared):
    shown(store, shared, "b", shared.parent)
    unpin(store, str(shared))
    collect_all(store)
    assert names(store) == []


@pytest.mark.parametrize("is_copied", [False, True])
def test_a_folder_of_this_host_under_the_same_path_frees_nothing_of_another_host(
    store, shared, tmp_path, is_copied
):
    """A copy of `out/`, such as by rsync, shows the same artifacts but is another folder."""
    shared.parent.rename(tmp_path / "theirs")
    if is_copied:
        shutil.copytree(tmp_path / "theirs", shared.parent, symlinks=True)
        (shared / "a").unlink()
    else:
        shown(store, shared, "b", shared.parent)
        (shared / "b").unlink()
    collect_all(store)
    assert names(store) == ["a"]


def test_a_shared_folder_whose_links_lead_elsewhere_here_frees_nothing(store, shared):
    """On the other host the store has another path."""
    (root,) = (store.root / "roots").iterdir()
    content = json.loads(root.read_text())
    root.write_text(json.dumps({**content, "store": f"{store.root}-there"}))
    (shared / "a").unlink()
    (shared / "a").symlink_to(f"{store.root}-there/objects/aa/a")
    collect_all(store)
    assert names(store) == ["a"]


def test_a_folder_on_another_disk_than_the_one_with_its_mark_frees_nothing_elsewhere(
    store, tmp_path, on_host
):
    """A machine may see `out/` and not what a link in it leads to."""
    on_host("there")
    for folder in (tmp_path / "disk", tmp_path / "out"):
        folder.mkdir()
    scene = tmp_path / "out/scene"
    scene.symlink_to(tmp_path / "disk")
    shown(store, scene, "a", tmp_path / "out")
    on_host("here")
    (tmp_path / "disk").rename(tmp_path / "away")
    collect_all(store)
    assert names(store) == ["a"]


def test_a_root_that_another_process_removes_meanwhile_keeps_nothing(store, tmp_path, monkeypatch):
    shown(store, tmp_path / "out", "a")
    listed = Path.iterdir
    monkeypatch.setattr(Path, "iterdir", lambda path: [*listed(path), path / ".removed"])
    collect_all(store)
    assert names(store) == ["a"]
    unpin(store, str(tmp_path / "out"))


@pytest.fixture
def public() -> Iterator[Path]:
    """A folder that anybody may enter."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        yield Path(folder)


@pytest.mark.parametrize("mode", [0o000, 0o444, 0o111])
def test_what_a_folder_showed_stays_for_a_user_who_may_not_read_it(public, mode):
    """It may not be listed, or its links may not be followed: it counted as empty."""
    store = Store.open(public / "store")
    out = shown(store, public / "out", "a")
    (held,) = roots(store).values()
    out.chmod(mode)
    identity = os.geteuid()
    if identity == 0:
        os.seteuid(NOBODY)
    try:
        assert list(roots(store).values()) == [held]
    finally:
        os.seteuid(identity)
        out.chmod(0o755)


def test_a_root_of_an_earlier_version_is_one_of_this_host(store, tmp_path):
    """It has no host, and its name depends on the folder alone."""
    out = shown(store, tmp_path / "out", "a")
    (root,) = (store.root / "roots").iterdir()
    content = json.loads(root.read_text())
    del content["host"]
    root.unlink()
    earlier = root.with_name(f".{typed_digest('pipeline-root-v1', os.fsencode(out))}")
    earlier.write_text(json.dumps(content))
    collect_all(store)
    assert names(store) == ["a"]
    out.rename(tmp_path / "away")
    collect_all(store)
    assert names(store) == ["a"], "the folder may be one of another host"
    (tmp_path / "away").rename(out)
    unpin(store, str(out))
    assert not earlier.exists()
    earlier.write_text(json.dumps(content))
    (out / "a").unlink()
    collect_all(store)
    assert names(store) == []
