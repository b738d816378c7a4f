"""Records of the shared store whose objects it has lost, as by a rule that deletes them by age."""

import pytest
from killing import make
from sharing_cases import build, is_whole
from store_toys import Sentence, Word, built

from pipeline.errors import StoreError
from pipeline.maintenance.command_line import main
from pipeline.settings import current_store
from pipeline.shared_store.remote import Remote
from pipeline.shared_store.settings import current_remote
from pipeline.shared_store.sync import SharedArtifacts, push, shared_record
from pipeline.store import Store


def object_of(word: Word) -> str:
    digest = word.record().output.digest
    return f"objects/{digest[:2]}/{digest}.tar"


@pytest.mark.usefixtures("inline")
def test_what_was_made_from_a_lost_object_is_found_on_another_machine(shared, elsewhere):
    build(Sentence())
    shared.remove(object_of(Word("hello")), object_of(Word("world")))
    before = built()
    elsewhere()
    assert Sentence().complete()
    assert build(Sentence())
    assert built() == before


@pytest.mark.usefixtures("inline")
def test_a_lost_object_that_a_build_needs_is_made_again_and_given_back(shared, elsewhere):
    build(Sentence())
    lost = object_of(Word("hello"))
    shared.remove(lost)
    before = built()
    there = elsewhere()
    assert build(Sentence(("hello", "moon")))
    assert built() == sorted([*before, "Sentence", "Word hello", "Word moon"])
    assert lost in shared.names("objects")
    assert there.find(Word("hello").action().key)


def test_a_shared_record_replaces_one_here_whose_object_is_lost(shared, store, elsewhere):
    """Another machine made the artifact again, with other bytes."""
    record = make(store, "a", "old")
    push(store, record, current_remote())
    shared.remove(*shared.names("objects"))
    here = SharedArtifacts(elsewhere("here"))
    assert here.lookup(record.action.key) == record
    assert here.find(record.action.key) is None
    newer = make(elsewhere("third"), "a", "new")
    assert push(current_store(), newer, current_remote()) == "pushed"
    assert here.find(record.action.key) == newer
    assert here.lookup(record.action.key) == newer


@pytest.mark.parametrize("is_before", [True, False])
def test_of_two_that_replace_a_lost_record_one_gives_the_record(
    shared, store, elsewhere, monkeypatch, is_before
):
    """The other one pushes right before or after the lost record is set aside."""
    lost = make(store, "a", "old")
    push(store, lost, current_remote())
    shared.remove(*shared.names("objects"))
    mine, said = make(first := elsewhere("first"), "a", "mine"), []
    theirs = make(second := elsewhere("second"), "a", "theirs")
    real = Remote.set_aside

    def beside_another(remote: Remote, name: str) -> str:
        monkeypatch.setattr(Remote, "set_aside", real)
        if is_before:
            said.append(push(second, theirs, remote))
        moved = real(remote, name)
        if not is_before:
            said.append(push(second, theirs, remote))
        return moved

    monkeypatch.setattr(Remote, "set_aside", beside_another)
    said.append(push(first, mine, current_remote()))
    assert said == ["pushed", "is there"]
    assert shared_record(current_remote(), lost.action.key) == theirs


@pytest.mark.usefixtures("inline")
def test_repair_does_not_restore_a_record_without_its_object(shared, store, capsys):
    build(Word("hello"))
    record = Word("hello").record()
    shared.remove(*shared.names("objects"))
    store.quarantine(store.object(record.output.digest))
    path = store.action(record.action.key)
    path.chmod(0o644)
    path.write_text("{}")
    assert main(["verify", "--repair"]) == 0
    assert "restored" not in capsys.readouterr().out
    assert is_whole(Store(store.root))


def test_a_request_that_fails_hides_no_object(shared, store, elsewhere, monkeypatch):
    """Nobody learned from it that the object is lost."""
    monkeypatch.setattr("pipeline.shared_store.remote.CIRCUIT_OPEN_S", 0.0)
    record = make(store, "a")
    push(store, record, current_remote())
    here = SharedArtifacts(elsewhere("here"))

    def away(*_request: object) -> None:
        raise StoreError("it is away")

    with monkeypatch.context() as outage:
        outage.setattr(Remote, "has", away)
        assert not here.fetch(record)
    assert here.is_available(record)
    assert here.fetch(record)


def test_an_object_that_is_not_there_is_not_requested_again_for_a_while(
    shared, store, elsewhere, monkeypatch
):
    record, requests = make(store, "a"), []
    push(store, record, current_remote())
    shared.remove(*shared.names("objects"))
    here, real = SharedArtifacts(elsewhere("here")), Remote.has
    monkeypatch.setattr(Remote, "has", lambda *which: (requests.append(which), real(*which))[1])
    assert not here.fetch(record)
    assert requests
    requests.clear()
    assert not here.is_available(record)
    assert not requests


def test_pull_replaces_a_record_here_whose_object_is_lost(shared, store, elsewhere, capsys):
    newer = make(store, "a", "new")
    push(store, newer, current_remote())
    here = elsewhere("here")
    lost = make(here, "a", "old")
    here.quarantine(here.object(lost.output.digest))
    assert main(["pull", newer.action.key]) == 0
    assert here.find(newer.action.key) == newer
