import contextlib
import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import quote

import cv2
import numpy as np
import pytest
from expected_errors import rejects
from huge_pictures import huge_png

from styletrf.content.coco_fetch import MOST_MISSING, coco_source
from styletrf.content.content_images import ContentConfig, write_content_images
from styletrf.errors import NetworkError

JPEG = cv2.imencode(".jpg", np.full((80, 80, 3), 90, np.uint8))[1].tobytes()


class Server(ThreadingHTTPServer):
    """Answers every path from a list of (status, body), the last of them for good."""

    answers: dict[str, list[tuple[int, bytes]]]
    asked: list[str]


class Handler(BaseHTTPRequestHandler):
    server: Server

    def do_GET(self) -> None:
        self.server.asked.append(self.path)
        left = self.server.answers[self.path]
        status, body = left.pop(0) if len(left) > 1 else left[0]
        self.send_response(status)
        self.send_header("Content-Length", str(len(JPEG) if status == 200 else len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *args: object) -> None:
        pass


@pytest.fixture
def server() -> Iterator[Server]:
    with Server(("127.0.0.1", 0), Handler) as server:
        server.answers, server.asked = {}, []
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def annotations(folder: Path, addresses: dict[str, str]) -> Path:
    images = [
        {"id": k, "file_name": name, "coco_url": address}
        for k, (name, address) in enumerate(addresses.items())
    ]
    path = folder / "instances.json"
    path.write_text(json.dumps({"images": images, "annotations": []}))
    (folder / "cache").mkdir(exist_ok=True)
    return path


def serve(server: Server, folder: Path, answers: dict[str, list[tuple[int, bytes]]]) -> Path:
    server.answers = {f"/{name}": list(given) for name, given in answers.items()}
    root = f"http://127.0.0.1:{server.server_port}"
    return annotations(folder, {name: f"{root}/{name}" for name in answers})


def test_an_image_is_fetched_once_and_kept(server: Server, tmp_path: Path):
    file = serve(server, tmp_path, {"1.jpg": [(200, JPEG)]})
    for _ in range(2):
        assert coco_source(file, tmp_path / "cache").read("1.jpg") == JPEG
    assert server.asked == ["/1.jpg"]
    assert [path.name for path in (tmp_path / "cache").iterdir()] == ["1.jpg"]


def test_an_image_that_cannot_be_kept_ends_the_fetch_with_the_place(server: Server, tmp_path: Path):
    file = serve(server, tmp_path, {"a.jpg": [(200, JPEG)]})
    source = coco_source(file, tmp_path / "missing/cache")
    with rejects(tmp_path / "missing/cache/a.jpg", "cannot be written"):
        source.read("a.jpg")


@pytest.mark.parametrize("first", [(503, b""), (200, JPEG[:200])])
def test_failures_are_tried_again_after_growing_pauses(
    server: Server, tmp_path: Path, first: tuple[int, bytes]
):
    pauses: list[float] = []
    file = serve(server, tmp_path, {"1.jpg": [first, first, (200, JPEG)]})
    assert coco_source(file, tmp_path / "cache", pause=pauses.append).read("1.jpg") == JPEG
    assert pauses == [1, 2]


def test_a_file_cut_short_by_a_kill_is_fetched_again(server: Server, tmp_path: Path):
    file = serve(server, tmp_path, {"1.jpg": [(200, JPEG)]})
    (tmp_path / "cache" / "1.jpg").write_bytes(JPEG[: len(JPEG) // 2])
    assert coco_source(file, tmp_path / "cache").read("1.jpg") == JPEG
    assert (tmp_path / "cache" / "1.jpg").read_bytes() == JPEG


def test_an_image_the_server_does_not_have_is_skipped(server: Server, tmp_path: Path):
    answers = {f"{k}.jpg": [(200, JPEG)] for k in range(8)} | {"gone.jpg": [(404, b"")]}
    file = serve(server, tmp_path, answers)
    (tmp_path / "out").mkdir()
    source = coco_source(file, tmp_path / "cache")
    summary = write_content_images(source, tmp_path / "out", ContentConfig())
    assert (summary.count, summary.skipped) == (8, ("gone.jpg",))


def test_an_image_of_too_many_pixels_is_skipped(server: Server, tmp_path: Path):
    file = serve(server, tmp_path, {"1.jpg": [(200, huge_png().ljust(len(JPEG), b"\0"))]})
    (tmp_path / "cache/1.jpg").write_bytes(huge_png())  # kept from another program
    pauses: list[float] = []
    assert coco_source(file, tmp_path / "cache", pause=pauses.append).read("1.jpg") == b""
    assert (tmp_path / "cache/1.jpg").read_bytes() == huge_png()


def test_a_server_that_refuses_everything_is_named_after_few_requests(
    server: Server, tmp_path: Path
):
    """A proxy that answers 403 was asked for every image of COCO, without a word."""
    file = serve(server, tmp_path, {f"{k}.jpg": [(403, b"")] for k in range(10 * MOST_MISSING)})
    source = coco_source(file, tmp_path / "cache")
    with rejects("127.0.0.1", 403, MOST_MISSING, kind=NetworkError):
        [source.read(name) for name in source.names]
    assert len(server.asked) == MOST_MISSING


@pytest.mark.parametrize("kept", [True, False])
def test_an_image_between_those_that_are_gone_shows_that_the_server_serves(
    server: Server, tmp_path: Path, kept: bool
):
    file = serve(server, tmp_path, {"1.jpg": [(200, JPEG)], "gone.jpg": [(404, b"")]})
    source = coco_source(file, tmp_path / "cache")
    for _ in range(2):
        for _ in range(MOST_MISSING - 1):
            assert source.read("gone.jpg") == b""
        if not kept:
            (tmp_path / "cache/1.jpg").unlink(missing_ok=True)
        assert source.read("1.jpg") == JPEG


@pytest.mark.parametrize(
    "name", ["caf\N{LATIN SMALL LETTER E WITH ACUTE}.jpg", "a b.jpg", "a%20b.jpg"]
)
def test_an_address_is_sent_with_what_it_may_not_contain_escaped(
    server: Server, tmp_path: Path, name: str
):
    escaped = quote(name, safe="%")
    server.answers = {f"/{escaped}?a=b%26c": [(200, JPEG)]}
    address = f"http://127.0.0.1:{server.server_port}/{name}?a=b%26c"
    file = annotations(tmp_path, {"1.jpg": address})
    assert coco_source(file, tmp_path / "cache").read("1.jpg") == JPEG


class Endless(BaseHTTPRequestHandler):
    """Sends until nobody listens any more."""

    sent = 0

    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()
        with contextlib.suppress(OSError):
            while True:
                type(self).sent += self.wfile.write(b"x" * 65536)

    def log_message(self, *args: object) -> None:
        pass


def test_an_image_without_end_is_refused_and_no_more_of_it_fetched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """It would fill the memory: a server, or who answers in its place, decides how much comes."""
    monkeypatch.setattr("styletrf.content.coco_fetch.LARGEST_BYTES", 1 << 20)
    pauses: list[float] = []
    with ThreadingHTTPServer(("127.0.0.1", 0), Endless) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/1.jpg"
        file = annotations(tmp_path, {"1.jpg": address})
        with rejects(address, "1 MiB") as caught:
            coco_source(file, tmp_path / "cache", pause=pauses.append).read("1.jpg")
        server.shutdown()
    assert caught.value.subject == address
    assert pauses == [], "and it is not asked for again"
    assert Endless.sent < 64 << 20, "the connection is closed; buffers hold a few MiB"
    assert list((tmp_path / "cache").iterdir()) == []


def test_an_image_as_large_as_allowed_is_taken(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("styletrf.content.coco_fetch.LARGEST_BYTES", len(JPEG))
    file = serve(server, tmp_path, {"1.jpg": [(200, JPEG)]})
    assert coco_source(file, tmp_path / "cache").read("1.jpg") == JPEG


def test_offline_is_a_clear_error_after_a_bounded_time(tmp_path: Path):
    pauses: list[float] = []
    file = annotations(tmp_path, {"1.jpg": "http://127.0.0.1:9/1.jpg"})
    with rejects("http://127.0.0.1:9/1.jpg", 4, kind=NetworkError) as caught:
        coco_source(file, tmp_path / "cache", pause=pauses.append).read("1.jpg")
    assert "folder" in caught.value.remedy
    assert sum(pauses) < 10
    assert list((tmp_path / "cache").iterdir()) == []


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"images": [{"id": 1}]}', '{"images": 3}', "\0\1"]
)
def test_other_files_are_an_input_error(tmp_path: Path, text: str):
    (tmp_path / "a.json").write_text(text)
    with rejects(tmp_path / "a.json", "COCO"):
        coco_source(tmp_path / "a.json", tmp_path)


@pytest.mark.parametrize(
    ("name", "address"),
    [
        ("../1.jpg", "http://x/1.jpg"),
        ("/1.jpg", "http://x/1.jpg"),
        ("1.jpg", "file:///1.jpg"),
        ("1.jpg", "http://[x/1.jpg"),
        ("1.jpg", "http:///1.jpg"),
        ("1.jpg", "http://x:99999/1.jpg"),
        ("1.jpg", "http://x y/1.jpg"),
    ],
)
def test_paths_and_addresses_that_reach_elsewhere_are_refused(
    tmp_path: Path, name: str, address: str
):
    with rejects(tmp_path / "instances.json", repr(name), address):
        coco_source(annotations(tmp_path, {name: address}), tmp_path / "cache")
