"""`styletrf view` as a process of its own."""

import json
import signal
import time
import urllib.request
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from command_output import forked
from forked_modules import ForkedModule


@dataclass(frozen=True)
class Viewing:
    """A server, and the page that it printed."""

    process: ForkedModule
    address: str

    def looks(self, least: int, seconds: float = 120) -> list[str]:
        """The names of the looks, when there are so many."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if (count := self.asked("state")["looks"]) >= least:
                return [self.asked(f"looks/{k}")["values"]["name"] for k in range(count)]
            time.sleep(0.5)
        raise AssertionError(self.asked("state"))

    def asked(self, place: str, body: object = None):
        content = None if body is None else json.dumps(body).encode()
        headers = {"Content-Type": "application/json"}
        request = urllib.request.Request(self.address + place, content, headers)
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.load(answer)

    def interrupted(self) -> int:
        """Its exit status after Ctrl-C."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(60)


@contextmanager
def viewing(words: Sequence[str], environment: Mapping[str, str]) -> Iterator[Viewing]:
    process = forked("tasks", "view", *words, stderr=None, **environment)
    try:
        lines = iter(process.stdout.readline, "")
        yield Viewing(
            process, next((line for line in lines if line.startswith("http")), "").strip()
        )
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
