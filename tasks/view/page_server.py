"""One page and its data over HTTP, for those who know its token.

A request is compared with the few addresses that there are, and none of it becomes the name of a
file. Writing is one POST, of limited size, that the page's own origin sends as JSON.
"""

import functools
import hmac
import json
import socket
import sys
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import ip_address
from typing import Any, Protocol
from urllib.parse import urlsplit

from styletrf.errors import InputError

MOST_BYTES = 1 << 18
"""The most bytes of a POST: a path of a thousand key frames."""
LOOPBACK = "127.0.0.1"
_PIECE_BYTES = 1 << 16
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'none'",  # the rest of it stands in the page
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",  # the address holds the token
    "X-Content-Type-Options": "nosniff",
}


class Site(Protocol):
    """The interface of a served page."""

    def page(self) -> bytes:
        """Returns the page, in UTF-16."""

    def state(self) -> dict[str, Any]:
        """Returns the number of looks, and the report on the present work."""

    def look(self, number: int) -> dict[str, Any] | None:
        """Returns a look, None if it does not exist."""

    def save(self, request: Any) -> dict[str, Any]:
        """Saves a path; raises InputError if it is not a path."""


class PageServer(ThreadingHTTPServer):
    """Serves a site on a port; several requests at a time.

    Attributes:
        site: To be set before requests are served.
    """

    daemon_threads = True
    site: Site

    def __init__(self, host: str, port: int, token: str) -> None:
        """Takes the port.

        Args:
            host: The address to listen on.
            port: 0 is a free one.
            token: Without it every request is refused.

        Raises:
            InputError: The port is taken, or the address is not of this machine.
        """
        self.host, self.token = host, token
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            super().__init__((host, port), _Handler)
        except (OSError, OverflowError) as error:
            reason = str(getattr(error, "strerror", None) or error).rstrip(".")
            problem = f"cannot be listened on: {reason}"
            remedy = "Give an address of this machine as --host, and a free port as --port or none"
            raise InputError(f"--host {host} --port {port}", problem, remedy) from error

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Reports an error, unless a browser just closed the connection."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)

    @property
    def address(self) -> str:
        """Returns the page's address, with its token.

        It has the machine's name if the server listens on all addresses of the machine.
        """
        host = socket.gethostname() if _is_unspecified(self.host) else self.host
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self.server_address[1]}/{self.token}/"


def is_loopback(host: str) -> bool:
    """Returns whether only this machine reaches an address."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _is_unspecified(host: str) -> bool:
    """Returns whether an address stands for all addresses of the machine."""
    try:
        return ip_address(host).is_unspecified
    except ValueError:
        return False


@functools.cache
def _names_of_machine() -> frozenset[str]:
    """Returns the names by which others open a page of this machine, in small letters."""
    name = socket.gethostname()
    local = f"{name.partition('.')[0]}.local"  # without a server of names (mDNS)
    return frozenset(each.lower() for each in (name, socket.getfqdn(), local))


def warning_of(host: str) -> str:
    """Returns a warning if other machines can reach the address, else ""."""
    if is_loopback(host):
        return ""
    return (
        f"Warning: whoever reaches {host} and has this address sees the scene, and can save a path."
        " The connection is not encrypted."
    )


def is_own_host(header: str, host: str) -> bool:
    """Returns whether a Host header can be of a page of this server.

    A page of somebody else, whose name is made to lead here (DNS rebinding), sends that name.

    Args:
        header: The name and the port that a browser believes to speak with.
        host: The address that the server listens on.
    """
    try:
        name = urlsplit(f"//{header}").hostname or ""
    except ValueError:
        return False
    try:
        return ip_address(name).is_loopback or not is_loopback(host)
    except ValueError:
        names = _names_of_machine() if _is_unspecified(host) else {host.lower()}
        return name == "localhost" or name in names


class _Handler(BaseHTTPRequestHandler):
    server: PageServer
    server_version, sys_version = "styletrf", ""
    timeout = 30.0  # of one call of the socket

    def do_GET(self) -> None:
        """Answers the page, its state, or a look."""
        place, site = self._place(), self.server.site
        if place is None:
            return
        kind, _, number = place.partition("/")
        if place == "":
            self._send(200, "text/html; charset=utf-16", site.page())
        elif place == "state":
            self._send_json(200, site.state())
        elif kind == "looks" and number.isdecimal() and (look := site.look(int(number[:6]))):
            self._send_json(200, look)
        else:
            self._refuse(404, "There is nothing here.")

    def do_POST(self) -> None:
        """Saves a path."""
        place = self._place()
        if place is None or self._is_refused(place):
            return
        try:
            request = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            self._send_json(200, self.server.site.save(request))
        except (ValueError, RecursionError):
            self._refuse(400, "This is not JSON.")
        except (InputError, OSError) as error:
            self._refuse(400, str(error))

    def log_message(self, *_fields: Any) -> None:
        """Logs nothing: requests hold the token."""

    def _place(self) -> str | None:
        """Returns the requested place below the token; None if the request is refused."""
        hosts = self.headers.get_all("Host") or []
        if len(hosts) != 1 or not is_own_host(hosts[0], self.server.host):
            self._refuse(403, "This server has another name.")
            return None
        segments = self.path.partition("?")[0].encode().split(b"/", 2)
        token = segments[1] if len(segments) > 1 else b""
        if not hmac.compare_digest(token, self.server.token.encode()) or len(segments) < 3:
            self._refuse(404, "There is nothing here.")
            return None
        return segments[2].decode()

    def _is_refused(self, place: str) -> bool:
        """Returns whether a POST has the wrong place, origin, kind or size, and answers it then."""
        origin, length = self.headers.get("Origin"), self.headers.get("Content-Length", "")
        if place != "path":
            self._refuse(404, "There is nothing here.")
        elif origin is not None and urlsplit(origin).netloc != self.headers["Host"]:
            self._refuse(403, "Another page cannot save a path.")
        elif self.headers.get_content_type() != "application/json":
            self._refuse(415, "A path is JSON.")
        elif not length.isdecimal():
            self._refuse(411, "The length is missing.")
        elif int(length[:12]) > MOST_BYTES:
            self._refuse(413, f"A path has at most {MOST_BYTES} bytes.")
        else:
            return False
        return True

    def _refuse(self, status: int, problem: str) -> None:
        self._send_json(status, {"problem": problem})

    def _send_json(self, status: int, values: dict[str, Any]) -> None:
        text = json.dumps(values, ensure_ascii=False)  # half as long for data
        self._send(status, "application/json", text.encode(errors="replace"))

    def _send(self, status: int, kind: str, content: bytes) -> None:
        self.send_response(status)
        headers = {"Content-Type": kind, "Content-Length": str(len(content)), **_HEADERS}
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        for start in range(0, len(content), _PIECE_BYTES):  # a timeout is of one call of `write`
            self.wfile.write(content[start : start + _PIECE_BYTES])
