"""A page opened in Debian's Chromium, which says what a script found in it."""

import http.server
import json
import os
import queue
import shutil
import signal
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

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
PROBE = """<script>
const until = async (holds) => { while (!holds()) await new Promise((r) => setTimeout(r, 20)); };
const overflow = () => document.documentElement.scrollWidth - document.documentElement.clientWidth;
const probe = async () => { BODY };
addEventListener("load", async () => {
  const found = await probe().catch((error) => ({ probe: String(error) }));
  parent.postMessage(JSON.stringify({ width: innerWidth, errors, ...found }), "*");
});
</script>"""
# A frame, since a window is never as narrow as a phone.
FRAME = """<iframe src="probe.html" style="width:{width}px;height:900px;border:0"
allow="autoplay"></iframe><script>addEventListener("message", (event) =>
fetch("http://127.0.0.1:{port}/", {{method: "POST", mode: "no-cors", body: event.data}}));
</script>"""
_TOUCH, _MOUSE = 1, 2  # of what the CSS feature `hover` tells
FLAGS = (
    *("headless", "no-sandbox", "disable-gpu", "disable-quic", "no-first-run", "mute-audio"),
    *("disable-background-networking", "disable-component-update", "disable-sync"),
    *("autoplay-policy=no-user-gesture-required", "window-size=1400,1000", "hide-scrollbars"),
    "remote-debugging-port=0",  # the port keeps it running
)


def answer_of(page: Path, probe: str, width: int, seconds: float = 60) -> dict[str, Any]:
    """Returns what the body of an async function returns in the page, with `width` and `errors`.

    It may call `until(holds)` and `overflow()`. Files are written beside the page.
    """
    scripts = IN_HEAD + PROBE.replace("BODY", probe)  # before a policy that would forbid them
    text = page.read_text().replace("<head>", "<head>" + scripts)
    page.with_name("probe.html").write_text(text)
    frame = page.with_name("frame.html")
    with _answers() as (port, received):
        frame.write_text(FRAME.format(width=width, port=port))
        with _browser(frame, _TOUCH if width < 700 else _MOUSE):
            try:
                return received.get(timeout=seconds)
            except queue.Empty:
                return pytest.fail(f"the page did not answer the probe within {seconds} s")


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
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield server.server_address[1], received
        finally:  # else a test that fails would keep its process from ending
            server.shutdown()
            thread.join()


@contextmanager
def _browser(page: Path, hover: int) -> Iterator[None]:
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        flags = (*FLAGS, f"user-data-dir={profile}", f"blink-settings=primaryHoverType={hover}")
        process = subprocess.Popen(
            [CHROMIUM, *(f"--{flag}" for flag in flags), page.as_uri()],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            yield
        finally:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
