"""Shared stores for the tests: a directory, a bucket on a real server, one behind a proxy."""

import contextlib
import http.client
import http.server
import os
import socket
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import fsspec


@dataclass(frozen=True)
class Place:
    """A shared store as somebody sees it who has the run of it."""

    url: str

    def files(self) -> tuple[Any, str]:
        options = {"use_listings_cache": False} if self.url.startswith("s3:") else {}
        return fsspec.core.url_to_fs(self.url, **options)

    def names(self, folder: str = "") -> list[str]:
        files, root = self.files()
        found = files.find(f"{root}/{folder}".rstrip("/"))
        return sorted(name.removeprefix(f"{root}/") for name in found)

    def read(self, name: str) -> bytes:
        files, root = self.files()
        return files.cat_file(f"{root}/{name}")

    def write(self, name: str, content: bytes) -> None:
        files, root = self.files()
        self.remove(name)
        if not self.url.startswith("s3:"):
            Path(root, name).parent.mkdir(parents=True, exist_ok=True)
        files.pipe_file(f"{root}/{name}", content)

    def remove(self, *names: str) -> None:
        files, root = self.files()
        for name in names:
            with contextlib.suppress(FileNotFoundError):
                files.rm_file(f"{root}/{name}")


class Server:
    """An S3 server in a process of its own."""

    def __init__(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as probe:
            self.port = probe.getsockname()[1]
        self.start()

    def start(self) -> None:
        """Start it, with nothing in it."""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(self.port)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        deadline = time.monotonic() + 60
        while True:
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port)):
                return
            assert time.monotonic() < deadline
            assert self.process.poll() is None
            time.sleep(0.05)

    def bucket(self) -> Place:
        """A new, empty bucket."""
        name = f"bucket-{uuid.uuid4().hex}"
        connection = http.client.HTTPConnection("127.0.0.1", self.port)
        connection.request("PUT", f"/{name}")
        assert connection.getresponse().status == 200
        connection.close()
        return Place(f"s3://{name}/store")

    def environment(self, port: int | None = None) -> dict[str, str]:
        """What an S3 client has to know."""
        return {
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port or self.port}",
            "AWS_ACCESS_KEY_ID": "a",
            "AWS_SECRET_ACCESS_KEY": "b",
            "AWS_DEFAULT_REGION": "us-east-1",
        }

    def kill(self) -> None:
        """As by a power failure."""
        self.process.kill()
        self.process.wait()


Fault = Callable[[str, str], int | float | None]


@dataclass
class Proxy:
    """Passes requests on to a server, unless `fault(method, path)` says otherwise.

    An integer is the HTTP status to answer with; a fraction, how much of the body to pass before
    the connection breaks. `end` ends it as a power failure would.
    """

    upstream: int
    end: Callable[[], None]
    fault: Fault = lambda method, path: None
    seen: list[tuple[str, str]] = field(default_factory=list)
    port: int = 0


@contextlib.contextmanager
def proxy_of(server: Server) -> Iterator[Proxy]:
    """A proxy before the server."""
    has_ended = threading.Event()

    def end() -> None:
        has_ended.set()
        listener.shutdown()
        listener.server_close()

    proxy = Proxy(server.port, end)

    class Handler(http.server.BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def pass_on(self) -> None:
            body = self._body()
            self.close_connection = has_ended.is_set()
            if self.close_connection:
                return
            proxy.seen.append((self.command, self.path))
            fault = proxy.fault(self.command, self.path)
            if isinstance(fault, int):
                self._answer(fault, [], _error(fault))
                return
            connection = http.client.HTTPConnection("127.0.0.1", proxy.upstream)
            connection.request(self.command, self.path, body, dict(self.headers))
            response = connection.getresponse()
            self._answer(response.status, response.getheaders(), response.read(), fault)
            connection.close()

        do_GET = do_PUT = do_POST = do_DELETE = do_HEAD = pass_on  # noqa: N815  as asked

        def _body(self) -> bytes:
            return self.rfile.read(int(self.headers.get("Content-Length") or 0))

        def _answer(self, status, headers, body, fraction=None) -> None:
            self.send_response(status)
            skipped = ("connection", "transfer-encoding", "date", "server", "content-length")
            for name, value in headers:
                if name.lower() not in skipped:
                    self.send_header(name, value)
            length = dict(headers).get("Content-Length") if self.command == "HEAD" else len(body)
            self.send_header("Content-Length", str(length or 0))
            self.end_headers()
            self.wfile.write(body if fraction is None else body[: int(len(body) * fraction)])
            self.close_connection = fraction is not None

        def log_message(self, *_args) -> None:
            pass

    listener = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    listener.daemon_threads = True
    proxy.port = listener.server_address[1]
    thread = threading.Thread(target=listener.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    yield proxy
    end()
    thread.join()


def _error(status: int) -> bytes:
    code = {403: "AccessDenied", 503: "SlowDown"}.get(status, "InternalError")
    return f"<Error><Code>{code}</Code><Message>as asked</Message></Error>".encode()


@contextlib.contextmanager
def read_only(place: Place) -> Iterator[None]:
    """A directory that may be read and not written, even for a superuser."""
    for folder in [Path(place.url), *filter(Path.is_dir, Path(place.url).rglob("*"))]:
        folder.chmod(0o555)
    identity = os.geteuid()
    if identity == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(identity)
