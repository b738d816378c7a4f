"""The summary of a grid: outcomes, exit status, files and webhook."""

import errno
import json
import os
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from types import SimpleNamespace

import luigi
import pytest
from message_words import mentions

import tasks
from pipeline.errors import TaskFailure
from pipeline.execution.deadline import require_time_left
from pipeline.job import write_outcome
from pipeline.maintenance.task_graph import upstream_first
from pipeline.settings import current_store, out_root
from pipeline.task import StoredTask
from tasks.stages.linked_results import LinkedStage, link_results
from tasks.summary import grid_summary
from tasks.summary.grid_summary import (
    CellOutcome,
    CostSummary,
    GridSummary,
    format_lines,
    publish_summary,
    summarize,
)

WORDS = {"quality": "draft", "content": "embedded"}


def summary(*outcomes: str) -> GridSummary:
    cells = [
        CellOutcome("yard", f"{k}", outcome, "Stage: why") for k, outcome in enumerate(outcomes)
    ]
    stage = CostSummary("RadianceField", 2, 1, 5400.0, 1800.0, 1 << 30, 3 << 20)
    return GridSummary(
        "2026-11-22T20:00:00+00:00", "2026-11-23T06:00:00+00:00", "host", cells, [], [stage], []
    )


def test_a_broken_scene_and_a_broken_style_are_named_with_their_reasons(out):
    grid = tasks.Grid(scenes=["mini", "nowhere"], styles=["p", "none"], **WORDS)
    found = summarize(grid.cells(), datetime.now(UTC))
    outcomes = {(cell.scene, cell.style): (cell.outcome, cell.reason) for cell in found.cells}
    outcome, reason = outcomes["mini", "p"]
    assert (outcome, bool(reason)) == ("not begun", True)
    assert outcomes["mini", "none"][0] == outcomes["nowhere", "p"][0] == "failed"
    assert mentions(outcomes["mini", "none"][1], "StyleImage", "'none'")
    assert mentions(outcomes["nowhere", "p"][1], "SceneCapture", "'nowhere'")
    lines = "\n".join(format_lines(found))
    assert mentions(lines, "4 cells", "3 failed", "1 not begun")
    assert lines.count("'nowhere'") == 1, "a reason appears once"


def test_linking_results_is_silent_about_cells_that_cannot_be_built(out, caplog):
    link_results(tasks.Grid(scenes=["mini", "nowhere"], styles=["p", "none"], **WORDS).cells())
    assert not caplog.messages


def test_a_cell_with_a_budget_counts_with_its_chosen_settings(out, monkeypatch):
    grid = tasks.Grid(scenes=["mini"], styles=["p"], budget="5min", content="embedded")
    chosen = tasks.StylizedTrajectory(scene="mini", style="none", **WORDS)
    monkeypatch.setattr(tasks.StylizedTrajectory, "resolved", lambda self: chosen)
    (cell,) = summarize(grid.cells(), datetime.now(UTC)).cells
    assert (cell.style, cell.outcome) == ("none", "failed")


def test_a_failure_of_an_earlier_run_is_no_reason(out):
    grid = tasks.Grid(scenes=["mini"], styles=["p"], **WORDS)
    (image,) = (t for t in upstream_first(grid) if t.task_family == "StyleImage")
    current_store().new_log("StyleImage", image.action().key).write_text("for want of luck\n")
    last_week = datetime.now(UTC) - timedelta(days=7)
    (cell,) = summarize(grid.cells(), last_week).cells
    assert (cell.outcome, cell.reason) == ("failed", "StyleImage: for want of luck")
    (cell,) = summarize(grid.cells(), datetime.now(UTC)).cells
    assert cell.outcome == "not begun"


def test_a_stage_skipped_for_until_is_late(out):
    grid = tasks.Grid(scenes=["mini"], styles=["p"], **WORDS)
    (image,) = (t for t in upstream_first(grid) if t.task_family == "StyleImage")
    begun, key = datetime.now(UTC), image.action().key
    with pytest.raises(TaskFailure) as failure:
        require_time_left(image, begun, None)
    assert failure.value.kind == "late"
    log = current_store().new_log("StyleImage", key)
    write_outcome(log, failure.value.kind, failure.value.reason)
    (cell,) = summarize(grid.cells(), begun).cells
    assert (cell.outcome, cell.reason) == ("late", f"StyleImage: {failure.value.reason}")


def test_artifacts_of_this_run_are_built_and_earlier_ones_found(out):
    grid = tasks.Grid(scenes=["mini"], styles=["p"], **WORDS)
    (image,) = (t for t in upstream_first(grid) if t.task_family == "StyleImage")
    before = datetime.now(UTC)
    assert luigi.build([image], local_scheduler=True, log_level="WARNING")
    ran = summarize(grid.cells(), before)
    (stage,) = ran.stages
    assert (stage.name, stage.built, stage.found) == ("StyleImage", 1, 0)
    assert stage.seconds > 0
    assert stage.bytes == image.record().output.size
    assert [scene.name for scene in ran.scenes] == ["all scenes"]
    (later,) = summarize(grid.cells(), datetime.now(UTC)).stages
    assert (later.built, later.found, later.bytes, later.seconds) == (0, 1, 0, 0)
    assert ran.cells[0].outcome == "not begun"


def test_an_artifact_that_scenes_share_counts_once_and_for_all_scenes(out, monkeypatch):
    """The network is one for both scenes, though each has a task for it."""
    now = datetime.now(UTC)

    def record(task):
        key = {"StyleNetwork": "shared", "SceneModel": task.task_id}.get(task.task_family)
        return key and SimpleNamespace(
            action=SimpleNamespace(family=task.task_family, key=key),
            provenance={"seconds": 60.0, "peak_memory_bytes": 1, "started": now.isoformat()},
            output=SimpleNamespace(digest=key, size=5),
        )

    monkeypatch.setattr(grid_summary, "found_record", record)
    monkeypatch.setattr(grid_summary, "_outcome", lambda cell, _: cell)
    grid = tasks.Grid(scenes=["mini", "other"], styles=["p"], **WORDS)
    ran = summarize(grid.cells(), now)
    assert {stage.name: (stage.built, stage.seconds) for stage in ran.stages} == {
        "SceneModel": (2, 120.0),
        "StyleNetwork": (1, 60.0),
    }
    assert {scene.name: scene.built for scene in ran.scenes} == {
        "mini": 1,
        "other": 1,
        "all scenes": 1,
    }


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
def test_the_exit_status_distinguishes_all_some_and_no_cells(outcomes, status):
    assert summary(*outcomes).exit_status == status


def test_a_summary_is_written_and_printed(out, caplog):
    caplog.set_level("INFO", "pipeline")
    publish_summary(summary("made", "failed"))
    written = json.loads((out / "grid.json").read_text())
    assert (out / "night.json").samefile(out / "grid.json"), "the name in earlier versions"
    assert [cell["outcome"] for cell in written["cells"]] == ["made", "failed"]
    assert written["stages"][0]["gpu_seconds"] == 1800
    assert mentions(caplog.text, "2 cells", "1 made", "1 failed", "yard 1", "Stage: why")
    assert mentions(caplog.text, "1.50 h", "0.50 h", "GPUs", "3 MiB")


def test_an_output_folder_that_cannot_be_written_is_a_warning(out, caplog):
    out.touch()
    publish_summary(summary("made"))
    assert mentions(caplog.text, out / "grid.json")


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
    thread = threading.Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/hook"
    server.shutdown()
    thread.join()
    server.server_close()
    luigi.configuration.get_config().remove_section("grid")


def test_a_summary_is_posted_to_the_webhook(out, address):
    luigi.configuration.get_config().set("grid", "webhook", address)
    publish_summary(replace(summary("made", "failed"), host="somewhere"))
    (heard,) = Listener.heard
    assert heard["host"] == "somewhere"
    assert mentions(heard["text"], "2 cells", "1 made", "1 failed")


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
        luigi.configuration.get_config().set("grid", "webhook", hook)
        publish_summary(summary("made"))
    assert mentions(caplog.text, "[grid] webhook", "luigi.cfg")
    assert hook not in caplog.text


def publish_to(listener: type[Listener], hook: str) -> None:
    """Publishes a summary; HERE in the address is the listener's, and HERES the same by https."""
    with HTTPServer(("127.0.0.1", 0), listener) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        here = f"://127.0.0.1:{server.server_port}"
        hook = hook.replace("HERES", f"https{here}").replace("HERE", f"http{here}")
        luigi.configuration.get_config().set("grid", "webhook", hook)
        try:
            publish_summary(summary("made"))
        finally:
            luigi.configuration.get_config().remove_section("grid")
            server.shutdown()


class Refusing(Listener):
    """Answers with an error that quotes what it was asked."""

    def do_POST(self) -> None:
        self.send_error(404, f"no {self.path}")


@pytest.mark.parametrize(
    ("hook", "problem"),
    [
        ("HERE/S3CRET", "404"),
        ("http://127.0.0.1:9/S3CRET", os.strerror(errno.ECONNREFUSED)),
        ("http://S3CRET.invalid/", "[grid] webhook"),
        ("http://127.0.0.1:S3CRET/", "InvalidURL"),
        ("http://127.0.0.1:9/S3CRET with spaces", "InvalidURL"),
        ("HERES/S3CRET", "SSLError"),
        ("S3CRET", "web address"),
        ("S3CRET://127.0.0.1/", "web address"),
        ("http:///S3CRET", "web address"),
        ("http://[S3CRET", "web address"),
    ],
)
def test_the_address_of_a_webhook_is_a_secret(out, caplog, capfd, hook, problem):
    """Who has it can post. Errors of the library, and answers of a server, quote it."""
    publish_to(Refusing, hook)
    assert mentions(caplog.text, "[grid] webhook", problem)
    said = capfd.readouterr()
    for text in (caplog.text, said.out, said.err, (out / "grid.json").read_text()):
        assert "s3cret" not in text.lower()


class Moved(Listener):
    """Answers with another address, where a request without a body succeeds."""

    status = 301

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers["Content-Length"]))
        self.send_response(self.status)
        self.send_header("Location", "/new")
        self.end_headers()

    def do_GET(self) -> None:
        self.heard.append({"path": self.path})
        self.send_response(200)
        self.end_headers()


@pytest.mark.parametrize("status", [301, 302, 303, 307])
def test_a_redirect_of_the_webhook_is_a_warning_unless_it_was_read(
    out, caplog, monkeypatch, status
):
    """Followed, it would be a request without the summary; 303 is the answer to one that was read.

    After the others, nobody knows: some servers answer 302 to what they read.
    """
    monkeypatch.setattr(Listener, "heard", [])
    monkeypatch.setattr(Moved, "status", status)
    publish_to(Moved, "HERE/hook")
    assert ("[grid] webhook" in caplog.text) is (status != 303)
    assert mentions(caplog.text, *([str(status), "may"] if status != 303 else []))
    assert "nothing" not in caplog.text
    assert not Listener.heard


class Page(LinkedStage):
    """A cell of a grid that takes no time."""

    scene, style = luigi.Parameter(), luigi.Parameter()
    revision = "1"

    def build(self, inputs: object, out: Path, run: object) -> None:
        (out / "report.html").write_text("a page")

    @property
    def folder(self) -> Path:
        return Path(out_root(), self.scene, self.style)

    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        return {"report.html": place(self) / "report.html"}

    def cells(self) -> list["Page"]:
        return [self]


@pytest.mark.usefixtures("inline")
def test_a_cell_that_cannot_be_linked_has_failed(out):
    """It is in the store, and its user sees nothing of it."""
    (out / "yard").mkdir(parents=True)
    (out / "yard" / "p").write_text("a file where the folder would be")
    begun, cells = datetime.now(UTC), [Page(scene="yard", style=style) for style in "pq"]
    assert not luigi.build(cells, local_scheduler=True, log_level="CRITICAL")
    found = summarize(cells, begun)
    assert [cell.outcome for cell in found.cells] == ["failed", "made"]
    assert found.exit_status == grid_summary.EXIT_STATUS["failed"]
    (out / "yard" / "p").unlink()
    link_results(cells)
    assert summarize(cells, begun).exit_status == 0


def test_commands_of_one_second_upload_lists_of_different_names(monkeypatch):
    uploaded: list[str] = []
    replaced = {
        "begin_of_command": lambda: datetime.fromtimestamp(0, UTC),
        "summarize": lambda *_: replace(summary("made"), keys=["ab" * 32]),
        "publish_summary": print,
        "refresh_gallery": lambda _: None,
        "upload_key_list": lambda _, name, keys: uploaded.append(name),
    }
    for name, value in replaced.items():
        monkeypatch.setattr(grid_summary, name, value)
    for process in (100, 101):
        monkeypatch.setattr(os, "getpid", lambda process=process: process)
        grid_summary.finish_command(SimpleNamespace(cells=list))
    assert len(set(uploaded)) == 2
