"""What a shared store gives is believed only where it is what was asked for."""

import io
import tarfile
from pathlib import Path

import pytest
from sharing_cases import build, flipped, is_whole, objects
from store_toys import Sentence, Word, built

from pipeline.shared_store.settings import current_remote
from pipeline.shared_store.sync import pull, shared_record


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


ON_BOTH = ("flipped", "upwards")
"""What is unpacked is checked in the same way wherever it comes from."""


@pytest.mark.usefixtures("inline")
@pytest.mark.parametrize(
    ("shared", "wrong"),
    [*(("directory", wrong) for wrong in WRONG), *(("s3", wrong) for wrong in ON_BOTH)],
    indirect=["shared"],
)
def test_wrong_bytes_are_rejected_set_aside_and_built_again(shared, elsewhere, wrong, tmp_path):
    build(Word("hello"))
    (name,) = shared.names("objects")
    good = shared.read(name)
    shared.write(name, WRONG[wrong](good, None))
    there = elsewhere()
    (record,) = (shared_record(current_remote(), Path(n).stem) for n in shared.names("actions"))
    assert pull(there, record, current_remote()) == "is damaged there"
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
@pytest.mark.parametrize("shared", ["directory"], indirect=True)
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
