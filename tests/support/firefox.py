"""Firefox on a display of its own, since without one it has no WebGL."""

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
XVFB = shutil.which("Xvfb")
needs_firefox = pytest.mark.skipif(
    FIREFOX is None or XVFB is None, reason="no Firefox, or no Xvfb, on PATH to open the page in"
)
PREFERENCES = {
    "webgl.force-enabled": "true",  # by software
    "browser.shell.checkDefaultBrowser": "false",
    "datareporting.policy.dataSubmissionEnabled": "false",
    "media.autoplay.default": "0",
}


@contextmanager
def firefox(address: str) -> Iterator[None]:
    """Has Firefox show an address."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, _display() as display:
        lines = [f'user_pref("{name}", {value});\n' for name, value in PREFERENCES.items()]
        Path(profile, "user.js").write_text("".join(lines))
        command = [str(FIREFOX), "--no-remote", "--profile", profile, address]
        environment = {**os.environ, "DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1"}
        with _running(command, environment):
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
