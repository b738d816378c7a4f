"""A page opened in Debian's Chromium, which says what a script found in it."""

import asyncio
import codecs
import http.server
import json
import os
import queue
import shutil
import signal
import subprocess
import tempfile
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

Browser = Callable[[str], AbstractContextManager[Any]]
"""Shows an address while the context lasts."""
CHROMIUM = shutil.which("chromium")
needs_chromium = pytest.mark.skipif(
    CHROMIUM is None, reason="no chromium on PATH to open the page in"
)
IN_HEAD = """<script>
const errors = [];
console.error = (...words) => errors.push(words.join(" "));
addEventListener("error", (event) => errors.push(event.message || event.target.outerHTML), true);
addEventListener("unhandledrejection", (event) => errors.push(String(event.reason)));
</script>"""
UNTIL = """
const until = async (holds) => { while (!holds()) await new Promise((r) => setTimeout(r, 20)); };
"""
PROBE = (
    f"""<script>{UNTIL}"""
    + """
const overflow = () => document.documentElement.scrollWidth - document.documentElement.clientWidth;
const probe = async () => { BODY };
addEventListener("load", async () => {
  const found = await probe().catch((error) => ({ probe: String(error) }));
  parent.postMessage(JSON.stringify({ width: innerWidth, errors, ...found }), "*");
});
</script>"""
)
# A frame, since a window is never as narrow as a phone.
FRAME = """<iframe src="probe.html" style="width:{width}px;height:900px;border:0"
allow="autoplay"></iframe><script>addEventListener("message", (event) =>
fetch("http://127.0.0.1:{port}/", {{method: "POST", mode: "no-cors", body: event.data}}));
</script>"""
_TOUCH, _MOUSE = 1, 2  # of what the CSS feature `hover` tells
_WIDEST_PHONE = 700
FLAGS = (
    *("headless", "no-sandbox", "disable-gpu", "disable-quic", "no-first-run", "mute-audio"),
    *("disable-background-networking", "disable-component-update", "disable-sync"),
    *("autoplay-policy=no-user-gesture-required", "window-size=1400,1000", "hide-scrollbars"),
    "remote-debugging-port=0",  # the port keeps it running
)


def answer_of(
    page: Path, probe: str, width: int, seconds: float = 60, browser: Browser | None = None
) -> dict[str, Any]:
    """Returns what the body of an async function returns in the page, with `width` and `errors`.

    It may call `until(holds)` and `overflow()`. Files are written beside the page. The browser is
    Chromium if none is given.
    """
    scripts = IN_HEAD + PROBE.replace("BODY", probe)  # before a policy that would forbid them
    with_text(page, page.with_name("probe.html"), "<head>", "<head>" + scripts)
    frame = page.with_name("frame.html")
    with _answers() as (port, received):
        frame.write_text(FRAME.format(width=width, port=port))
        shown = browser or partial(_browser, hover=_hover(width))
        with shown(frame.as_uri()):
            try:
                return received.get(timeout=seconds)
            except queue.Empty:
                return pytest.fail(f"the page did not answer the probe within {seconds} s")


def page_text(page: Path) -> str:
    """Returns a page's text, which is in UTF-16 if its first bytes say so."""
    data = page.read_bytes()
    return data.decode("utf-16" if data.startswith(codecs.BOM_UTF16_LE) else "utf-8")


def with_text(page: Path, copy: Path, old: str, new: str) -> None:
    """Writes a copy of a page with a text replaced, in UTF-16, which scripts in it may need."""
    text = page_text(page)
    assert old in text, f"{page} has no {old}"
    copy.write_text(text.replace(old, new), encoding="utf-16")


@contextmanager
def _answers() -> Iterator[tuple[int, "queue.Queue[dict[str, Any]]"]]:
    received: queue.Queue[dict[str, Any]] = queue.Queue()

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_POST(self):
            received.put(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *args):
            pass

    with http.server.HTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        try:
            yield server.server_address[1], received
        finally:  # else a test that fails would keep its process from ending
            server.shutdown()
            thread.join()


class OpenPage:
    """A page as its server sends it: scripts run beside its policy, and nothing is added to it.

    Attributes:
        errors: What failed, was forbidden by the policy, or was logged as an error, so far.
    """

    def __init__(self, socket: Any, runner: asyncio.Runner) -> None:
        self.errors: list[str] = []
        self._socket, self._runner, self._number = socket, runner, 0

    def run(self, body: str) -> Any:
        """Returns what the body of an async function returns; it may call `until(holds)`."""
        answer = self.command(
            "Runtime.evaluate", expression=f"(async () => {{ {UNTIL} {body} }})()",
            awaitPromise=True, returnByValue=True,
        )  # fmt: skip
        if "exceptionDetails" in answer:
            pytest.fail(str(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def command(self, method: str, seconds: float = 120, **words: Any) -> Any:
        """Returns the browser's answer to a command of its protocol."""
        return self._runner.run(asyncio.wait_for(self._answer(method, words), seconds))

    def close(self) -> None:
        """Ends the connection, not the browser."""
        self._runner.run(self._closed())

    async def _closed(self) -> None:
        self._socket.close()
        while await self._socket.read_message() is not None:
            pass

    async def _answer(self, method: str, words: dict[str, Any]) -> Any:
        self._number += 1
        await self._socket.write_message(
            json.dumps({"id": self._number, "method": method, "params": words})
        )
        while True:
            message = json.loads(await self._socket.read_message() or "{}")
            if message.get("id") == self._number:
                return message["result"]
            self._note(message.get("method"), message.get("params", {}))

    def _note(self, event: str | None, what: dict[str, Any]) -> None:
        is_error = event == "Runtime.exceptionThrown" or (
            event == "Log.entryAdded" and what["entry"]["level"] == "error"
        )
        if is_error or (event == "Runtime.consoleAPICalled" and what["type"] == "error"):
            self.errors.append(json.dumps(what))


def _hover(width: int) -> int:
    return _TOUCH if width < _WIDEST_PHONE else _MOUSE


@contextmanager
def opened(address: str, width: int = 1000) -> Iterator[OpenPage]:
    """Opens an address in a window of a width; a narrow one is a phone's, which fingers touch."""
    from tornado.websocket import websocket_connect

    with _browser("about:blank", _hover(width)) as profile, asyncio.Runner() as runner:

        async def connected() -> Any:
            return await websocket_connect(_debugger(profile), max_message_size=1 << 28)

        page = OpenPage(runner.run(connected()), runner)
        for domain in ("Runtime", "Log", "Page"):
            page.command(f"{domain}.enable")
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        page.command("Emulation.setDeviceMetricsOverride", **size)
        page.command("Emulation.setTouchEmulationEnabled", enabled=_hover(width) == _TOUCH)
        page.command("Page.navigate", url=address)
        page.run("await until(() => document.readyState === 'complete');")
        try:
            yield page
        finally:
            page.close()


def _debugger(profile: Path, seconds: float = 60) -> str:
    """Returns the address by which the browser's first page takes commands."""
    end, found = time.monotonic() + seconds, profile / "DevToolsActivePort"
    while time.monotonic() < end:
        if found.exists() and (port := found.read_text().partition("\n")[0]):
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
                pages = [page for page in json.load(answer) if page["type"] == "page"]
            if pages:
                return str(pages[0]["webSocketDebuggerUrl"])
        time.sleep(0.1)
    return pytest.fail(f"no page in the browser within {seconds} s")


@contextmanager
def _browser(address: str, hover: int) -> Iterator[Path]:
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        flags = (*FLAGS, f"user-data-dir={profile}", f"blink-settings=primaryHoverType={hover}")
        process = subprocess.Popen(
            [CHROMIUM, *(f"--{flag}" for flag in flags), address],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            yield Path(profile)
        finally:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
