"""Collection and its neighbors as a user types them."""

import json
import subprocess
import sys

import pytest
from collection_cases import made, names
from commands import pipeline
from killing import make, wrong
from message_words import mentions

from pipeline.maintenance.command_line import main


def test_gc_deletes_what_no_pin_keeps_and_du_counts_each_byte_once(store):
    """As a user types them: gc tells, pin and unpin decide, du counts each byte once."""
    shared = made(store, "fern", "the same")
    made(store, "horns", "the same", inputs=[shared])
    other = made(store, "orchid")
    rows = json.loads(pipeline("du", "--json")[1])
    assert rows == [
        {"family": "Toy", "count": 2, "size_bytes": 14},
        {"scene": "fern, horns", "count": 1, "size_bytes": 8},
        {"scene": "orchid", "count": 1, "size_bytes": 6},
    ]
    status, said = pipeline("pin", other.output.digest[:10], "--name", "best")
    assert (status, said.split()) == (0, ["name", "key", "best", other.action.key[:12]])
    policy = ("--grace", "0", "--keep-last", "0")
    rows = json.loads(pipeline("gc", *policy, "--json")[1])
    fates = {row["what"]: row["fate"] for row in rows}
    assert fates["artifacts"] == "stays"
    assert "orchid" not in fates
    assert set(fates) >= {"horns", "actions", "runs"}
    assert len(names(store)) == 3, "it was only asked"
    assert pipeline("gc", *policy, "--delete")[0] == 0
    assert names(store) == ["orchid"]
    assert pipeline("unpin", "best") == (0, "")
    assert pipeline("unpin", "best")[0] == 2
    assert pipeline("gc", *policy, "--delete")[0] == 0
    assert names(store) == []
    assert not wrong(store)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ("gc --grace nan", ["--grace", "nan"]),
        ("gc --grace -1", ["--grace", "-1"]),
        ("gc --keep-last -1", ["--keep-last", "-1"]),
        ("ls Wrd", ["Wrd", "Toy"]),
    ],
)
def test_what_cannot_be_meant_is_refused(store, words, named, capsys):
    made(store, "a")
    (store.root / "logs" / "Toy").mkdir()
    try:
        status = main(words.split())
    except SystemExit as end:
        status = end.code
    assert status == 2
    assert mentions(capsys.readouterr().err.splitlines()[-1], *named)


def test_what_nobody_reads_to_its_end_is_no_error(store):
    for name in map(str, range(100)):
        made(store, name) if name == "0" else make(store, name)
    line = f"{sys.executable} -m pipeline ls --json | head -0"
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {line}"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (1, "", "")


@pytest.mark.parametrize("command", ["ls", "verify", "gc", "du", "pin", "push", "why Word"])
def test_commands_make_no_store(tmp_path, command, capsys):
    assert main(command.split()) == 2
    assert mentions(capsys.readouterr().err, tmp_path / "store")
    assert not (tmp_path / "store").exists()


def test_the_usual_policy_keeps_a_day_and_three_runs(store):
    made(store, "a")
    assert pipeline("gc", "--delete")[0] == 0
    assert names(store) == ["a"]


def test_an_interrupted_command_ends_with_130(store, monkeypatch, capsys):
    def interrupted(*_words: object, **_options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pipeline.maintenance.store_commands.problems", interrupted)
    try:
        status = main(["verify"])
    except KeyboardInterrupt:  # it would end the tests
        pytest.fail("it ends with a traceback")
    assert status == 130
    assert capsys.readouterr().err


@pytest.mark.parametrize("scene", ["lego (1)", "fern, at dusk", "a=b"])
def test_du_has_the_whole_name_of_a_scene(store, scene, capsys):
    make(store, scene)
    assert main(["du", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["scene"] for row in rows if "scene" in row] == [scene]
