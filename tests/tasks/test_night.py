"""What became of a grid."""

import json
import socket
import threading
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from http.server import BaseHTTPRequestHandler, HTTPServer

import luigi
import pytest

import tasks
from pipeline.errors import TaskFailure
from pipeline.execution.deadline import require_time_left
from pipeline.job import write_outcome
from pipeline.settings import current_store
from tasks.night import CellOutcome, Night, Spending, in_words, look_back, tell
from tasks.showing import show_all

WORDS = {"quality": "draft", "content": "embedded"}


def night(*outcomes: str) -> Night:
    cells = [
        CellOutcome("yard", f"{k}", outcome, "Stage: why") for k, outcome in enumerate(outcomes)
    ]
    stage = Spending("RadianceField", 2, 1, 5400.0, 1800.0, 1 << 30, 3 << 20)
    return Night(
        "2026-11-22T20:00:00+00:00", "2026-11-23T06:00:00+00:00", "host", cells, [], [stage], []
    )


def test_one_broken_scene_and_one_broken_style_are_named_with_their_reasons(out):
    grid = tasks.Grid(scenes=["mini", "nowhere"], styles=["p", "none"], **WORDS)
    found = look_back(grid.cells(), datetime.now(UTC))
    told = {(cell.scene, cell.style): (cell.outcome, cell.reason) for cell in found.cells}
    assert told["mini", "p"] == ("not begun", "this machine has tried nothing")
    assert told["mini", "none"][0] == told["nowhere", "p"][0] == "failed"
    assert "StyleImage: style 'none'" in told["mini", "none"][1]
    assert "SceneCapture: scene 'nowhere'" in told["nowhere", "p"][1]
    lines = "\n".join(in_words(found))
    assert "4 cells: 3 failed, 1 not begun" in lines
    assert lines.count("scene 'nowhere'") == 1, "a reason is told once"


def test_what_cannot_be_made_is_told_once_and_not_that_it_cannot_be_shown(out, caplog):
    show_all(tasks.Grid(scenes=["mini", "nowhere"], styles=["p", "none"], **WORDS).cells())
    assert not caplog.messages


def test_the_resolved_request_is_the_cell(out, monkeypatch):
    """What was asked for is made with the settings that were chosen."""
    grid = tasks.Grid(scenes=["mini"], styles=["p"], budget="5min", content="embedded")
    chosen = tasks.StylizedTrajectory(scene="mini", style="none", **WORDS)
    monkeypatch.setattr(tasks.StylizedTrajectory, "resolved", lambda self: chosen)
    (cell,) = look_back(grid.cells(), datetime.now(UTC)).cells
    assert (cell.style, cell.outcome) == ("none", "failed")


def test_what_failed_another_night_is_no_reason_today(out):
    grid = tasks.Grid(scenes=["mini"], styles=["p"], **WORDS)
    (image,) = (t for t in tasks.graph.graph(grid) if t.task_family == "StyleImage")
    current_store().new_log("StyleImage", image.action().key).write_text("for want of luck\n")
    last_week = datetime.now(UTC) - timedelta(days=7)
    (cell,) = look_back(grid.cells(), last_week).cells
    assert (cell.outcome, cell.reason) == ("failed", "StyleImage: for want of luck")
    (cell,) = look_back(grid.cells(), datetime.now(UTC)).cells
    assert cell.outcome == "not begun"


def test_what_was_late_is_told_from_what_nobody_came_to(out):
    grid = tasks.Grid(scenes=["mini"], styles=["p"], **WORDS)
    (image,) = (t for t in tasks.graph.graph(grid) if t.task_family == "StyleImage")
    begun, key = datetime.now(UTC), image.action().key
    with pytest.raises(TaskFailure) as failure:
        require_time_left(image, begun, None)
    assert failure.value.kind == "late"
    log = current_store().new_log("StyleImage", key)
    write_outcome(log, failure.value.kind, failure.value.reason)
    (cell,) = look_back(grid.cells(), begun).cells
    assert cell.outcome == "late"
    assert cell.reason.startswith("StyleImage: not begun: 0 s are left until")


def test_what_was_built_this_time_is_told_from_what_was_found(out):
    grid = tasks.Grid(scenes=["mini"], styles=["p"], **WORDS)
    (image,) = (t for t in tasks.graph.graph(grid) if t.task_family == "StyleImage")
    before = datetime.now(UTC)
    assert luigi.build([image], local_scheduler=True, log_level="WARNING")
    ran = look_back(grid.cells(), before)
    (stage,) = ran.stages
    assert (stage.name, stage.built, stage.found) == ("StyleImage", 1, 0)
    assert stage.seconds > 0
    assert stage.bytes == image.record().output.size
    assert [scene.name for scene in ran.scenes] == ["all scenes"]
    (later,) = look_back(grid.cells(), datetime.now(UTC)).stages
    assert (later.built, later.found, later.bytes, later.seconds) == (0, 1, 0, 0)
    assert ran.cells[0].outcome == "not begun"


@pytest.mark.parametrize(
    ("outcomes", "status"),
    [
        (["made", "found"], 0),
        (["made", "failed", "late"], 31),
        (["found", "late"], 26),
        (["found", "not begun"], None),
        (["made", "under way"], None),
        (["failed", "failed"], None),
    ],
)
def test_the_status_tells_a_part_from_nothing_and_from_all(outcomes, status):
    assert night(*outcomes).exit_status == status


def test_it_is_written_and_said(out, caplog):
    caplog.set_level("INFO", "pipeline")
    tell(night("made", "failed"))
    told = json.loads((out / "night.json").read_text())
    assert [cell["outcome"] for cell in told["cells"]] == ["made", "failed"]
    assert told["stages"][0]["gpu_seconds"] == 1800
    for words in (
        "2 cells: 1 made, 1 failed",
        "1.50 h, 0.50 h of them on GPUs",
        "3 MiB",
        "yard 1: Stage: why",
    ):
        assert words in caplog.text


def test_a_place_that_cannot_be_written_is_no_failure(out, caplog):
    out.touch()
    tell(night("made"))
    assert "night.json could not be written" in caplog.text


class Listener(BaseHTTPRequestHandler):
    heard: list[dict] = []  # noqa: RUF012  of the test's server

    def do_POST(self) -> None:
        self.heard.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
        self.send_response(204)
        self.end_headers()

    def log_message(self, *_words: object) -> None:
        pass


@pytest.fixture
def address() -> Iterator[str]:
    server = HTTPServer(("127.0.0.1", 0), Listener)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/hook"
    server.shutdown()
    thread.join()
    server.server_close()
    luigi.configuration.get_config().remove_section("night")


def test_a_webhook_hears_of_it(out, address):
    luigi.configuration.get_config().set("night", "webhook", address)
    tell(replace(night("made", "failed"), host="somewhere"))
    (heard,) = Listener.heard
    assert heard["host"] == "somewhere"
    assert heard["text"].startswith("2 cells: 1 made, 1 failed")


@pytest.mark.parametrize("is_there", [False, True])
def test_a_webhook_that_does_not_answer_is_a_warning(out, address, caplog, is_there):
    """Nobody listens; or who does speaks no HTTP."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        hook = f"http://127.0.0.1:{server.getsockname()[1] if is_there else 9}/"

        def answer() -> None:
            connection, _ = server.accept()
            connection.recv(1 << 16)
            connection.sendall(b"garbage\r\n\r\n")
            connection.close()

        if is_there:
            threading.Thread(target=answer, daemon=True).start()
        luigi.configuration.get_config().set("night", "webhook", hook)
        tell(night("made"))
    assert "nothing was posted to [night] webhook" in caplog.text
    assert hook not in caplog.text


class Refusing(Listener):
    """Answers with an error that quotes what it was asked."""

    def do_POST(self) -> None:
        self.send_error(404, f"no {self.path}")


@pytest.mark.parametrize(
    ("hook", "told"),
    [
        ("HERE/S3CRET", "the server answered 404"),
        ("http://127.0.0.1:9/S3CRET", "Connection refused"),
        ("http://S3CRET.invalid/", "[night] webhook"),
        ("http://127.0.0.1:S3CRET/", "did not answer as one does (InvalidURL)"),
        ("http://127.0.0.1:9/S3CRET with spaces", "did not answer as one does (InvalidURL)"),
        ("HERES/S3CRET", "no secure connection (SSLError)"),
        ("S3CRET", "it is no web address"),
        ("S3CRET://127.0.0.1/", "it is no web address"),
        ("http:///S3CRET", "it is no web address"),
        ("http://[S3CRET", "it is no web address"),
    ],
)
def test_the_address_of_a_webhook_is_a_secret(out, caplog, capfd, hook, told):
    """Who has it can post. Errors of the library, and answers of a server, quote it."""
    with HTTPServer(("127.0.0.1", 0), Refusing) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        here = f"://127.0.0.1:{server.server_port}"
        hook = hook.replace("HERES", f"https{here}").replace("HERE", f"http{here}")
        luigi.configuration.get_config().set("night", "webhook", hook)
        try:
            tell(night("made"))
        finally:
            luigi.configuration.get_config().remove_section("night")
            server.shutdown()
    assert told in caplog.text
    said = capfd.readouterr()
    for text in (caplog.text, said.out, said.err, (out / "night.json").read_text()):
        assert "s3cret" not in text.lower()
