"""With a key, a shared store gives only what a holder of the key wrote: here, and in a bucket."""

import dataclasses
import errno
import hashlib
import json
import logging
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import luigi
import pytest
from checkpoint_cases import KEY, failing, folder, uploaded
from expected_failures import refuses
from message_words import mentions
from shared_stores import Place
from sharing_cases import build, command, is_whole
from store_toys import Sentence, Word, built

from pipeline.digest import tree_digest, typed_digest
from pipeline.record import ActionRecord
from pipeline.shared_store.archive import pack
from pipeline.shared_store.checkpoints import shared_checkpoints
from pipeline.shared_store.settings import current_remote
from pipeline.shared_store.signatures import (
    SHORTEST_KEY,
    SignatureError,
    from_signed_text,
    signature,
    signed_text,
)
from pipeline.shared_store.sync import shared_record

pytestmark = pytest.mark.usefixtures("inline")
OURS, THEIRS = b"our key" * 8, b"their key" * 8
Sign = Callable[[bytes], None]


@pytest.fixture
def sign(tmp_path: Path) -> Iterator[Sign]:
    """Has what is shared signed by a key from now on; by none if that is empty."""
    config, file = luigi.configuration.get_config(), tmp_path / "signing.key"

    def by(key: bytes) -> None:
        file.write_bytes(key + b"\n")
        config.set("store", "signing_key", str(file) if key else "")

    yield by
    config.set("store", "signing_key", "")


def warnings(caplog: pytest.LogCaptureFixture) -> list[str]:
    of_sharing = [r for r in caplog.records if (r.name, r.levelname) == ("pipeline", "WARNING")]
    return [record.getMessage() for record in of_sharing]


def test_machines_with_the_key_share(shared: Place, elsewhere, sign: Sign, caplog):
    sign(OURS)
    build(Sentence())
    before = built()
    there = elsewhere()
    assert Sentence().complete()
    assert build(Sentence())
    assert built() == before
    assert is_whole(there)
    assert not warnings(caplog)


def test_without_a_key_signed_records_are_records(shared: Place, elsewhere, sign: Sign):
    sign(OURS)
    build(Word("hello"))
    sign(b"")
    elsewhere()
    assert Word("hello").complete()


@pytest.mark.parametrize("key", [b"", THEIRS])
def test_what_is_not_signed_by_the_key_is_built_again_and_replaced(
    shared: Place, elsewhere, sign: Sign, caplog, key: bytes
):
    sign(key)
    build(Sentence())
    before = built()
    sign(OURS)
    there = elsewhere()
    with caplog.at_level(logging.WARNING):
        assert not Sentence().complete()
        assert build(Sentence())
    assert sorted(built()) == sorted([*before, *before])
    assert len(warnings(caplog)) == 1, "said once, not for each record"
    assert mentions(warnings(caplog)[0], "record", shared.url)
    assert mentions(warnings(caplog)[0], "unsigned") == (not key)
    assert is_whole(there)
    elsewhere("third")
    assert Sentence().complete(), "what was built again is signed"


def test_a_result_of_another_is_not_passed_off_under_a_signature(
    shared: Place, elsewhere, sign: Sign, tmp_path: Path
):
    """Who may write to the bucket, and has no key, gives a record another object."""
    sign(OURS)
    build(Word("hello"))
    (name,) = shared.names("actions")
    text = shared.read(name)
    record, mark = from_signed_text(text, OURS), text[text.index(b"hmac-sha256") :]
    forged = folder(tmp_path / "forged", **{"word.txt": "<script>"})
    other = dataclasses.replace(record, output=tree_digest(forged))
    pack(forged, tmp_path / "forged.tar")
    at = f"objects/{other.output.digest[:2]}/{other.output.digest}.tar"
    assert current_remote().create(at, tmp_path / "forged.tar")
    shared.write(name, other.to_json())
    sign(b"")
    elsewhere("believing")
    assert Word("hello").record() == other, "without a key it is believed"
    sign(OURS)
    for forgery in (other.to_json(), other.to_json() + b"\n\n" + mark, text.replace(b"0", b"1")):
        shared.write(name, forgery)
        assert shared_record(current_remote(), record.action.key) is None
    shared.write(name, text)
    assert shared_record(current_remote(), record.action.key) == record


def test_a_signed_record_is_no_record_of_another_key(shared: Place, elsewhere, sign: Sign):
    sign(OURS)
    build(Word("hello"), Word("world"))
    first, second = shared.names("actions")
    shared.write(second, shared.read(first))
    elsewhere()
    assert shared_record(current_remote(), Path(second).stem) is None


def test_the_commands_take_signed_records_alone(shared: Place, elsewhere, sign: Sign, capsys):
    build(Word("old"))
    sign(OURS)
    build(Word("new"))
    elsewhere()
    assert command(capsys, "pull", Word("new").action().key)[0] == 0
    old = Word("old").action().key
    status, said = command(capsys, "pull", old)
    assert (status, mentions(said, old)) == (2, True)


@pytest.mark.parametrize("key", [b"", THEIRS])
def test_a_checkpoint_that_is_not_signed_is_passed_over(
    shared: Place, sign: Sign, tmp_path: Path, caplog, key: bytes
):
    """What goes on from it would be as wrong as it is."""
    sign(key)
    with failing(folder(tmp_path / "here", checkpoint="theirs")):
        pass
    sign(OURS)
    with shared_checkpoints(KEY, folder(tmp_path / "there")):
        assert not list((tmp_path / "there").iterdir())
    (warning,) = warnings(caplog)
    assert mentions(warning, "checkpoint", shared.url)
    assert len(uploaded()) == 1


@pytest.mark.parametrize("reader", [b"", OURS])
def test_a_signed_checkpoint_is_gone_on_from(
    shared: Place, sign: Sign, tmp_path: Path, reader: bytes
):
    sign(OURS)
    with failing(folder(tmp_path / "here", checkpoint="ours")):
        pass
    sign(reader)
    with shared_checkpoints(KEY, folder(tmp_path / "there")):
        assert (tmp_path / "there" / "checkpoint").read_text() == "ours"


@pytest.mark.parametrize(
    ("content", "named"),
    [(None, [os.strerror(errno.ENOENT)]), (b"short\n", ["5 bytes", SHORTEST_KEY])],
    ids=["no file", "short"],
)
def test_a_key_that_cannot_be_used_is_reported_and_nothing_is_shared(
    shared: Place, sign: Sign, tmp_path: Path, content: bytes | None, named: list[object], caplog
):
    """Going on without would upload what no other machine believes."""
    sign(OURS)
    file = tmp_path / "signing.key"
    file.unlink()
    if content is not None:
        file.write_bytes(content)
    with refuses("[store] signing_key", file, "openssl rand -hex 32", *named):
        current_remote()
    assert not build(Word("hello"))
    assert shared.names() == []


def test_the_signing_key_is_in_no_file_and_no_log(shared: Place, sign: Sign, elsewhere, caplog):
    sign(OURS)
    build(Sentence())
    assert "our key" not in repr(current_remote())
    assert "our key" not in caplog.text
    assert not any(b"our key" in shared.read(name) for name in shared.names())


def test_a_record_survives_its_seal(shared: Place, sign: Sign):
    build(Word("hello"))
    record = Word("hello").record()
    assert from_signed_text(signed_text(record, OURS), OURS) == record
    assert signed_text(record, b"") == record.to_json(), "off by default"
    with pytest.raises(SignatureError):
        from_signed_text(signed_text(record, b""), OURS)
    with pytest.raises(json.JSONDecodeError):
        from_signed_text(b"garbage", OURS)
    flipped = signed_text(record, OURS)[:-3] + b"\xff\xff\n"
    with pytest.raises(SignatureError):
        from_signed_text(flipped, OURS)
    assert ActionRecord.from_json(record.to_json()) == record


def test_a_signature_is_that_of_the_standard():
    """By RFC 2104's definition, H(K xor opad, H(K xor ipad, text)), and another for each kind."""
    text, padded = typed_digest("kind", b"part").encode(), OURS.ljust(64, b"\0")
    inner = hashlib.sha256(bytes(byte ^ 0x36 for byte in padded) + text).digest()
    outer = hashlib.sha256(bytes(byte ^ 0x5C for byte in padded) + inner).hexdigest()
    assert signature(OURS, "kind", b"part") == outer
    assert signature(OURS, "other", b"part") != outer
