"""Whoever has the token reads the page and saves a path; nobody else reads or writes anything."""

import http.client
import io
import json
import socket
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest
from message_words import mentions

from styletrf.errors import InputError
from tasks.view.page_server import MOST_BYTES, PageServer, is_own_host, warning_of

TOKEN = "a-token-that-nobody-guesses"
PATH = {"key_frames": [{"position": [0, 0, 0], "orientation": [1, 0, 0, 0]}]}
REQUEST = {"path": PATH, "seconds": 8, "a": 0, "b": 0, "share": 1}
JSON = {"Content-Type": "application/json"}


def asked(served, method: str, place: str, body: bytes | str | None = None, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", served.port, timeout=30)
    words = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.putrequest(method, place, skip_host="Host" in words)
    content = body.encode() if isinstance(body, str) else body
    for name, value in words.items():
        connection.putheader(name, value)
    if content is not None and "Content-Length" not in words:
        connection.putheader("Content-Length", str(len(content)))
    connection.endheaders(content)
    answer = connection.getresponse()
    found = answer.status, answer.read(), dict(answer.getheaders())
    connection.close()
    return found


def posted(served, request, place: str = f"/{TOKEN}/path", **headers):
    body = request if isinstance(request, str) else json.dumps(request)
    return asked(served, "POST", place, body, **{**JSON, **headers})


def test_the_token_opens_the_page_and_its_data(served):
    status, page, headers = asked(served, "GET", f"/{TOKEN}/")
    assert (status, page.decode("utf-16")[:15]) == (200, "<!doctype html>")
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["Cache-Control"] == "no-store"
    assert TOKEN not in page.decode("utf-16")
    state = json.loads(asked(served, "GET", f"/{TOKEN}/state")[1])
    assert state["looks"] == 1
    look = json.loads(asked(served, "GET", f"/{TOKEN}/looks/0")[1])
    assert look["values"]["name"] == "Photographs"


@pytest.mark.parametrize(
    "place",
    [
        "/",
        f"/{TOKEN}",
        f"/{TOKEN[:-1]}/",
        f"/{TOKEN}x/state",
        "//",
        f"/{TOKEN.upper()}/",
        f"/{TOKEN}/looks/1",
        f"/{TOKEN}/looks/-1",
        f"/{TOKEN}/looks/0x0",
        f"/{TOKEN}/looks/%30",
        f"/{TOKEN}/looks/99999999999999999999",
        f"/{TOKEN}/path",
        f"/{TOKEN}/../../../../etc/passwd",
        f"/{TOKEN}/looks/../../../../../etc/passwd",
        f"/{TOKEN}/%2e%2e/%2e%2e/etc/passwd",
        f"/{TOKEN}//etc/passwd",
        f"/{TOKEN}/camera-path.json",
        f"http://127.0.0.1/{TOKEN}/",
        "/\xff\xfe/",
    ],
)
def test_every_other_address_holds_nothing(served, place):
    connection = socket.create_connection(("127.0.0.1", served.port), timeout=30)
    with connection, connection.makefile("rb") as answer:
        line = f"GET {place} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
        connection.sendall(line.encode("latin-1"))
        status, text = answer.readline(), answer.read()
    assert b" 404 " in status
    assert b"root:" not in text


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "", "127.0.0.1.evil.example"])
def test_a_name_that_is_not_the_servers_is_refused(served, host):
    assert asked(served, "GET", f"/{TOKEN}/", Host=host)[0] == 403
    assert posted(served, REQUEST, Host=host)[0] == 403
    assert not served.file.exists()


@pytest.mark.parametrize(
    ("header", "host", "is_own"),
    [
        ("127.0.0.1:80", "127.0.0.1", True),
        ("localhost:80", "127.0.0.1", True),
        ("localhost", "127.0.0.1", True),
        ("LOCALHOST:80", "127.0.0.1", True),
        ("[::1]:80", "127.0.0.1", True),
        ("10.0.0.7:80", "127.0.0.1", False),
        ("10.0.0.7:80", "0.0.0.0", True),
        ("studio:80", "studio", True),
        ("evil.example:80", "0.0.0.0", False),
        ("studio.evil.example:80", "0.0.0.0", False),
        (f"{socket.gethostname()}:80", "127.0.0.1", False),
        ("[evil", "127.0.0.1", False),
    ],
)
def test_the_names_of_a_server_are_its_address_and_what_leads_to_it_alone(header, host, is_own):
    assert is_own_host(header, host) is is_own


@pytest.mark.parametrize("host", ["0.0.0.0", "::"])
def test_a_server_on_all_addresses_has_the_machines_names_and_prints_one(host):
    name = socket.gethostname()
    names = name, name.upper(), socket.getfqdn(), f"{name.partition('.')[0]}.local"
    assert all(is_own_host(f"{each}:80", host) for each in names)
    with PageServer("0.0.0.0", 0, TOKEN) as server:
        assert urlsplit(server.address).hostname == name.lower()


class SlowConnection:
    """A connection of which a call of `sendall` ends within the timeout or fails, as a socket's."""

    def __init__(self, request: bytes, bytes_per_s: float) -> None:
        self.request, self.bytes_per_s, self.received = request, bytes_per_s, b""

    def settimeout(self, timeout_s: float) -> None:
        self.timeout_s = timeout_s

    def makefile(self, *_: object) -> io.BytesIO:
        return io.BytesIO(self.request)

    def sendall(self, data: bytes) -> None:
        if len(data) > self.bytes_per_s * self.timeout_s:
            raise TimeoutError
        self.received += data


def test_a_reader_who_is_slow_but_steady_receives_the_whole_page():
    page = bytes(range(256)) * 8192
    request = f"GET /{TOKEN}/ HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
    with PageServer("127.0.0.1", 0, TOKEN) as server:
        server.site = SimpleNamespace(page=lambda: page)
        reader = SlowConnection(request, bytes_per_s=1e4)
        server.RequestHandlerClass(reader, ("127.0.0.1", 1), server)
    assert len(page) > reader.bytes_per_s * reader.timeout_s
    assert reader.received.endswith(page)


def test_only_an_address_that_others_reach_has_a_warning():
    assert [warning_of(host) for host in ("127.0.0.1", "::1", "localhost", "127.8.8.8")] == [""] * 4
    for host in ("0.0.0.0", "::", "10.0.0.7", "studio"):
        assert mentions(warning_of(host), host, "encrypted")


def test_a_server_answers_at_its_own_address_alone(served):
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", served.port), timeout=30).close()


def test_a_path_is_saved_in_its_one_file(served):
    status, answer, _ = posted(served, REQUEST)
    assert status == 200
    found = json.loads(answer)
    assert found["file"] == str(served.file)
    assert f"--path {served.file} --seconds 8" in found["command"]
    assert json.loads(served.file.read_text())["key_frames"] == PATH["key_frames"]
    assert [path.name for path in served.file.parent.iterdir()] == [served.file.name]


@pytest.mark.parametrize(
    ("request_", "headers", "status"),
    [
        ("no JSON", {}, 400),
        ("[" * 100_000, {}, 400),
        ([], {}, 400),
        ({"path": PATH}, {}, 400),
        (REQUEST | {"path": {"key_frames": []}}, {}, 400),
        (REQUEST | {"path": PATH | {"file": "/etc/passwd"}}, {}, 400),
        (REQUEST | {"seconds": 1e9}, {}, 400),
        (REQUEST | {"seconds": "8; rm"}, {}, 400),
        (REQUEST | {"a": 7}, {}, 400),
        (json.dumps(REQUEST).replace("8", "NaN"), {}, 400),
        (REQUEST, {"Content_Type": "text/plain"}, 415),
        (REQUEST, {"Origin": "http://evil.example"}, 403),
        (REQUEST, {"Origin": "null"}, 403),
        (REQUEST, {"Content_Length": "-1"}, 411),
        (REQUEST, {"Content_Length": str(MOST_BYTES + 1)}, 413),
    ],
)
def test_what_is_no_path_of_the_page_is_refused_and_writes_nothing(
    served, request_, headers, status
):
    headers = {"Content_Type": "application/json", **headers}
    body = request_ if isinstance(request_, str) else json.dumps(request_)
    found, answer, _ = asked(served, "POST", f"/{TOKEN}/path", body, **headers)
    assert found == status
    assert json.loads(answer)["problem"]
    assert not served.file.parent.exists()


def test_requests_to_other_places_or_of_other_kinds_are_refused(served):
    for place in ("/path", f"/{TOKEN}/", f"/{TOKEN}/state", f"/{TOKEN}/path/../x.json"):
        assert posted(served, REQUEST, place)[0] == 404
    for method in ("PUT", "DELETE", "OPTIONS"):
        assert asked(served, method, f"/{TOKEN}/path")[0] == 501


def test_a_port_that_is_taken_is_named(served):
    with pytest.raises(InputError) as error:
        PageServer("127.0.0.1", served.port, TOKEN)
    assert str(served.port) in error.value.subject
