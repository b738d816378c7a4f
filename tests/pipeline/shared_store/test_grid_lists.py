"""The list of what a batch made: nobody has to list a shared store of millions."""

import pytest
from message_words import mentions
from sharing_cases import build, command, objects
from store_toys import Sentence, Word

from pipeline.settings import current_store
from pipeline.shared_store.sync import upload_key_list


@pytest.mark.usefixtures("inline")
def test_what_is_on_the_list_comes_and_nothing_else(shared, elsewhere, capsys):
    assert build(Sentence(), Word("other"))
    keys = [task.action().key for task in (Word("hello"), Sentence())]
    upload_key_list(current_store(), "20261122T200000Z-host", keys)
    there = elsewhere()
    status, rows = command(capsys, "pull", "--grid", "20261122T200000Z-host")
    assert (status, {row["done"] for row in rows}) == (0, {"fetched"})
    assert len(objects(there)) == 2


@pytest.mark.usefixtures("inline")
def test_one_of_the_list_can_be_named(shared, elsewhere, capsys):
    assert build(Word("a"), Word("b"))
    keys = [Word(word).action().key for word in "ab"]
    upload_key_list(current_store(), "grid", keys)
    there = elsewhere()
    assert command(capsys, "pull", keys[0][:12], "--night", "grid")[0] == 0, "the former name"
    assert len(objects(there)) == 1


@pytest.mark.usefixtures("inline")
def test_a_list_of_an_earlier_version_is_read(shared, elsewhere, capsys):
    assert build(Word("a"), Word("b"))
    shared.write("nights/former.keys", f"{Word('a').action().key}\n".encode())
    there = elsewhere()
    assert command(capsys, "pull", "--grid", "former")[0] == 0
    assert len(objects(there)) == 1


def test_an_unknown_grid_is_answered_with_those_there_are(shared, capsys):
    upload_key_list(current_store(), "grid1", ["ab" * 32])
    status, said = command(capsys, "pull", "--grid", "grid2")
    assert status == 2
    assert mentions(said, shared.url, "grid2", "grid1")


def test_all_of_a_shared_store_has_to_be_meant(shared, capsys):
    status, said = command(capsys, "pull")
    assert status == 2
    assert mentions(said, "KEY", "DIGEST", "--grid")
