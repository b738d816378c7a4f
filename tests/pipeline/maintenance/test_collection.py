import json
import os
import tempfile
import time
from pathlib import Path

import pytest
from collection_cases import collect_all, made, names, used
from commands import start
from expected_failures import refuses
from killing import action_of, holds, living, run
from message_words import mentions
from store_toys import Sentence, Word

import pipeline.maintenance.garbage_collection
from pipeline.digest import Tree, typed_digest
from pipeline.locks import locked
from pipeline.maintenance.ancestors import ancestors
from pipeline.maintenance.garbage_collection import collect, size_bytes
from pipeline.maintenance.roots import add_folder_root, pin, pins, unpin
from pipeline.publication import commit
from pipeline.record import ActionRecord
from pipeline.settings import current_store
from pipeline.store import Store


def test_a_dry_run_says_what_would_go_and_touches_nothing(store):
    made(store, "a", files=3)
    before = sorted(store.root.rglob("*"))
    said = collect(store, keep_last=0, grace_hours=0)
    assert sorted(store.root.rglob("*")) == sorted({*before, store.root / "gc.lock"})
    (thing,) = (decision for decision in said if decision.path.parent.parent.name == "objects")
    assert (thing.what, thing.size, thing.delete) == ("a", 3, True)
    assert [decision.path for decision in collect_all(store)] == [
        decision.path for decision in said
    ]
    assert not any(decision.path.exists() for decision in said)


def test_a_pin_keeps_its_artifact_with_all_it_was_made_from(store):
    source = made(store, "source")
    middle = made(store, "middle", inputs=[source])
    last = made(store, "last", inputs=[middle, source])
    made(store, "after", inputs=[last])
    pin(store, last.action.key, "paper")
    assert pins(store) == {"paper": last.action.key}
    said = collect_all(store)
    assert names(store) == ["last", "middle", "source"]
    assert holds(store, source, middle, last)
    stays = [decision for decision in said if not decision.delete]
    assert {decision.why for decision in stays} == {"pinned or shown"}
    assert len(stays) == 3
    pin(store, source.action.key, "paper")
    collect_all(store)
    assert names(store) == ["source"], "the name went to another one"
    unpin(store, "paper")
    collect_all(store)
    assert names(store) == []


@pytest.mark.parametrize("name", ["../format", "a/b", ".hidden", ""])
def test_a_pin_has_the_name_of_a_file(store, name):
    with refuses(repr(name)):
        pin(store, made(store, "a").action.key, name)
    with refuses(store.root, repr(name), "`pin`"):
        unpin(store, name)


def test_a_folder_that_shows_artifacts_keeps_them_as_long_as_it_does(store, tmp_path):
    old, new = made(store, "old"), made(store, "new", inputs=[made(store, "source")])
    out = tmp_path / "out" / "scene"
    out.mkdir(parents=True)
    (out / "notes.txt").write_text("the user's own")
    (out / "elsewhere").symlink_to("/nowhere")
    add_folder_root(store, out, [])
    for record, expected in ((old, ["old"]), (new, ["new", "source"]), (None, [])):
        (out / "frames").unlink(missing_ok=True)
        if record:
            (out / "frames").symlink_to(store.object(record.output.digest) / "deep")
        for each in ("old", "source"):
            made(store, each)
        made(store, "new", inputs=[made(store, "source")])
        collect_all(store)
        assert names(store) == expected
    assert (out / "notes.txt").exists()


def test_what_a_folder_shows_stays_though_its_record_was_lost(store, tmp_path):
    record = made(store, "a")
    add_folder_root(store, tmp_path, [])
    (tmp_path / "link").symlink_to(store.object(record.output.digest))
    store.action(record.action.key).unlink()
    collect_all(store)
    assert (tmp_path / "link" / "deep" / "0").read_text() == "a"


def test_what_a_folder_showed_stays_while_its_disk_is_away(store, tmp_path, tmp_path_factory):
    """A link stands for the mount: without it, the folder's file system is not to be seen."""
    places = tmp_path_factory.mktemp("disk"), Path("/dev/shm")
    others = [place for place in places if place.stat().st_dev != tmp_path.stat().st_dev]
    if not others:
        pytest.skip("wants a second file system, as /dev/shm may be")
    target = store.object(made(store, "a").output.digest) / "deep"
    with tempfile.TemporaryDirectory(dir=others[0]) as disk:
        mount, out = tmp_path / "mount", tmp_path / "mount" / "out"
        mount.symlink_to(disk)
        out.mkdir()
        add_folder_root(store, out, [target])
        mount.unlink()
        collect_all(store)
        assert names(store) == ["a"]
        mount.symlink_to(disk)
        out.rmdir()
        collect_all(store)
        assert names(store) == [], "the disk is back, and the folder was deleted"


def test_what_a_folder_away_showed_can_be_given_up(store, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    add_folder_root(store, out, [store.object(made(store, "a").output.digest)])
    (root,) = (store.root / "roots").iterdir()
    content = json.loads(root.read_text())
    root.write_text(json.dumps({**content, "device": content["device"] + 1}))
    out.rmdir()
    collect_all(store)
    assert names(store) == ["a"]
    unpin(store, str(out))
    collect_all(store)
    assert names(store) == []


def test_a_root_that_cannot_be_read_stops_it_before_anything_goes(store, tmp_path):
    made(store, "a")
    add_folder_root(store, tmp_path, [])
    (root,) = (store.root / "roots").iterdir()
    root.write_text("{")
    with refuses(root):
        collect_all(store)
    assert names(store) == ["a"]


def test_what_lies_beside_a_log_stays_with_it(store, monkeypatch):
    record = made(store, "a")
    folder = store.root / "logs" / "Toy"
    folder.mkdir()
    for name in ("mine.1.log", "mine.1.colmap", "other.1.colmap"):
        (folder / name).touch()
    provenance = dict(record.provenance) | {"log": "logs/Toy/mine.1.log"}
    store.action(record.action.key).unlink()
    commit(store, ActionRecord(record.action, record.output, provenance), store.find)
    pin(store, record.action.key, "kept")
    monkeypatch.setattr(pipeline.maintenance.garbage_collection, "_is_younger", lambda *_: False)
    decisions = collect(store, keep_last=0, grace_hours=0)
    assert [v.path.name for v in decisions if v.what == "logs"] == ["other.1.colmap"]


def test_a_link_is_deleted_without_what_it_leads_to(store, tmp_path):
    theirs = tmp_path / "theirs"
    theirs.mkdir(mode=0o500)
    (store.root / "tmp" / "link").symlink_to(theirs)
    collect_all(store)
    assert not list((store.root / "tmp").iterdir())
    assert not list((store.root / "trash").iterdir())
    assert theirs.stat().st_mode & 0o777 == 0o500


def test_what_vanishes_meanwhile_counts_nothing(store, tmp_path):
    (tmp_path / "link").symlink_to(store.root)
    assert size_bytes(tmp_path / "gone") == 0
    assert size_bytes(tmp_path / "link") == len(str(store.root)), "not what is there"


def test_a_collection_that_has_to_wait_says_so(store):
    with locked(store.root / "gc.lock", shared=True):
        process = start("pipeline", "gc", "--delete")
        assert mentions(process.stderr.readline(), "store", "waits")
        assert process.poll() is None
    process.communicate(timeout=30)
    assert process.returncode == 0


def test_the_last_runs_keep_what_they_used_whoever_made_it(store):
    artifacts = [made(store, name, inputs=[made(store, f"{name} source")]) for name in "abc"]
    for record in artifacts:
        used(store, record)
    run(lambda: Store(store.root).find("0" * 64))  # it found nothing: no run to count
    collect(store, keep_last=2, grace_hours=0, delete=True)
    assert names(store) == ["b", "b source", "c", "c source"]
    collect(store, keep_last=1, grace_hours=0, delete=True)
    assert names(store) == ["c", "c source"]
    assert len(list((store.root / "runs").iterdir())) == 1


def test_what_is_young_stays_and_so_does_what_a_young_run_used(store):
    old, found = made(store, "old"), made(store, "found")
    moment = time.time()
    time.sleep(0.05)
    made(store, "young", inputs=[made(store, "old source")])
    used(store, found)
    collect(store, keep_last=0, grace_hours=(time.time() - moment) / 3600, delete=True)
    assert names(store) == ["found", "old source", "young"]
    assert not store.object(old.output.digest).exists()


def test_a_living_process_keeps_what_it_found(store):
    record = made(store, "a", inputs=[made(store, "source")])
    mine = Store(store.root)

    def still_there() -> None:
        assert holds(mine, *mine.records())
        assert names(mine) == ["a", "source"]

    with living(lambda: mine.find(record.action.key), still_there):
        run(lambda: collect_all(store))
    run(lambda: collect_all(store))
    assert names(store) == []


def test_a_year_of_reruns_with_equal_bytes_keeps_one_history(store):
    """Of many records that made the same object, the newest stands for it; the others go."""
    for night in range(5):
        source = made(store, f"source {night}")
        model = made(store, f"model {night}", "equal bytes", inputs=[source])
    last = made(store, "last", inputs=[model])
    pin(store, last.action.key, "last")
    collect_all(store)
    assert names(store) == ["last", "model 4", "source 4"]


def test_a_record_without_its_object_stays_while_a_kept_one_was_made_from_it(store):
    """A record whose object is gone stays while anything kept was made from it."""
    source = made(store, "source")
    last = made(store, "last", inputs=[source])
    store.quarantine(store.object(source.output.digest))
    pin(store, last.action.key, "last")
    collect_all(store)
    assert store.record(source.action.key) == source
    assert not store.find(source.action.key)


@pytest.mark.parametrize("garbage", [b"", b"[]", b'{"format": 2}', b"\xff"])
def test_a_record_that_cannot_be_read_stops_it_before_anything_goes(store, garbage):
    record, other = made(store, "a"), made(store, "b")
    store.action(record.action.key).chmod(0o644)
    store.action(record.action.key).write_bytes(garbage)
    left = store.root / "trash" / "left"
    left.touch()
    for delete in (False, True):
        with refuses(store.action(record.action.key), "`verify --repair`"):
            collect(store, keep_last=0, grace_hours=0, delete=delete)
    assert store.object(record.output.digest).is_dir()
    assert holds(store, other)
    assert list((store.root / "trash").iterdir()) == [left]


def test_gc_deletes_what_ended_processes_left_and_spares_living_ones(store, monkeypatch):
    kept = made(store, "kept")
    pin(store, kept.action.key, "kept")
    swept = ["quarantine/x/f", "tmp/left/f", "tmp/f.json", "code/ab/abc.json", "trash/x/f"]
    monthly = ["logs/Toy/0.1.log", f"resume/{'0' * 64}/f"]
    for name in swept + monthly:
        (store.root / name).parent.mkdir(parents=True, exist_ok=True)
        (store.root / name).touch()
    code = store.root / "code" / "cc" / f"{kept.action.code}.json"
    code.parent.mkdir()
    code.touch()
    with store.workspace("1" * 64) as workspace:
        collect(store, keep_last=0, delete=True)
        assert all((store.root / name).exists() for name in swept[:4]), "younger than a day"
        collect_all(store)
        assert workspace.exists()
    assert not any((store.root / name).exists() for name in swept)
    assert all((store.root / name).exists() for name in monthly), "younger than a month"
    assert code.exists()
    in_a_month = time.time() + 31 * 24 * 3600
    monkeypatch.setattr(pipeline.maintenance.garbage_collection.time, "time", lambda: in_a_month)
    collect_all(store)
    assert not any((store.root / name).exists() for name in monthly)
    assert pins(store) == {"kept": kept.action.key}


@pytest.mark.usefixtures("inline")
def test_a_run_lists_the_keys_it_resolved_complete_or_not():
    assert not Sentence().complete()
    Word("hello").run()
    Word("world").run()
    Sentence().run()
    (path,) = (current_store().root / "runs").iterdir()
    keys = path.read_text().split()
    tasks = (Word("hello"), Word("world"), Sentence())
    assert {task.action().key for task in tasks} == set(keys)
    assert len(keys) == 3, "each once"
    process = Path(path.name).stem.split("-")
    assert process[-1] == str(os.getpid())


def test_thousands_of_records_are_collected_in_seconds(store):
    """Half of them pinned through one chain; written without a flush, which is not the point."""
    previous, keys = "", []
    for number in range(2_000):
        digest = typed_digest("toy", str(number).encode())
        action = action_of(str(number), *([previous] if number % 2 and previous else []))
        provenance = {"label": str(number), "task": "", "started": f"{number:06}"}
        provenance |= {"seconds": 0.0, "log": ""}
        record = ActionRecord(action, Tree(digest, 1, 1), provenance)
        store.action(action.key).parent.mkdir(exist_ok=True)
        store.action(action.key).write_bytes(record.to_json())
        store.object(digest).mkdir(parents=True)
        (store.object(digest) / "file").write_text("x")
        if number % 2:
            previous, keys = digest, [*keys, action.key]
    pin(store, keys[-1], "last")
    started = time.process_time()
    collect_all(store)
    assert time.process_time() - started < 4  # 1 on one idle core
    assert len(list(store.records())) == 1_000


def test_a_closure_is_found_in_linear_time():
    known = {}
    for number in range(20_000):
        action = action_of(str(number), *(str(k) for k in range(max(0, number - 3), number)))
        known[str(number)] = ActionRecord(action, Tree(str(number), 1, 1), {})
    started = time.process_time()
    assert len(ancestors([str(19_999)], known)) == 20_000
    assert time.process_time() - started < 10
