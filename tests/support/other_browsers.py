"""Firefox, and the engine of Safari, on a display of their own: without one they have no WebGL."""

import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

FIREFOX = shutil.which("firefox") or shutil.which("firefox-esr")
WEBKIT = next(iter(sorted(Path("/usr/lib").glob("*/webkit2gtk-4.*/MiniBrowser"))), None)
XVFB = shutil.which("Xvfb")
needs_firefox = pytest.mark.skipif(
    FIREFOX is None or XVFB is None, reason="no Firefox, or no Xvfb, on PATH to open the page in"
)
needs_webkit = pytest.mark.skipif(
    WEBKIT is None or XVFB is None, reason="no MiniBrowser of WebKitGTK, or no Xvfb"
)
BY_SOFTWARE = {"LIBGL_ALWAYS_SOFTWARE": "1", "WEBKIT_DISABLE_DMABUF_RENDERER": "1"}
PREFERENCES = {
    "webgl.force-enabled": "true",  # by software
    "browser.shell.checkDefaultBrowser": "false",
    "datareporting.policy.dataSubmissionEnabled": "false",
    "media.autoplay.default": "0",
}


@contextmanager
def firefox(address: str) -> Iterator[None]:
    """Has Firefox show an address."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        lines = [f'user_pref("{name}", {value});\n' for name, value in PREFERENCES.items()]
        Path(profile, "user.js").write_text("".join(lines))
        with _shown([str(FIREFOX), "--no-remote", "--profile", profile, address]):
            yield


@contextmanager
def webkit(address: str) -> Iterator[None]:
    """Has WebKitGTK's own small browser show an address."""
    with _shown([str(WEBKIT), "--private", "--geometry=1400x1000", address]):
        yield


@contextmanager
def _shown(command: list[str]) -> Iterator[None]:
    environment = {**os.environ, **BY_SOFTWARE}
    with _display() as display, _running(command, {**environment, "DISPLAY": display}):
        yield


@contextmanager
def _display() -> Iterator[str]:
    """Yields the name of a display in memory; the server chooses its number."""
    reading, writing = os.pipe()
    command = [str(XVFB), "-displayfd", str(writing), "-screen", "0", "1400x1000x24"]
    with _running(command, dict(os.environ), keeping=writing), os.fdopen(reading) as numbers:
        os.close(writing)
        yield f":{numbers.readline().strip()}"


@contextmanager
def _running(command: list[str], environment: dict[str, str], keeping: int = -1) -> Iterator[None]:
    process = subprocess.Popen(
        command, env=environment, start_new_session=True, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL, pass_fds=() if keeping < 0 else (keeping,),
    )  # fmt: skip
    try:
        yield
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
