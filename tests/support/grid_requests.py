"""Requests of a grid to an S3 store: `python tests/support/grid_requests.py`.

A grid of mini fixtures, with a real S3 server behind a proxy that counts: built by one machine,
found by another that has nothing yet, and once more by the first.
"""

import sys
import tempfile
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from small_grids import GridRun, prepare

sys.path.append(str(Path(__file__).parents[1] / "pipeline/support"))
from shared_stores import Proxy, Server, proxy_of


def requests_of(grid: GridRun, proxy: Proxy, environment: Mapping[str, str]) -> Counter[str]:
    """How often the grid's command asks for what, by the kind of request and the folder."""
    proxy.seen.clear()
    screen, _ = (command := grid.begin(**environment)).communicate()
    if command.returncode:
        raise SystemExit(screen)
    return Counter(f"{method} {_folder(path)}" for method, path in proxy.seen)


def _folder(path: str) -> str:
    listed = path.partition("prefix=")[2].replace("%2F", "/")
    words = (listed.partition("&")[0] if listed else path.partition("?")[0]).strip("/").split("/")
    return ("list " if listed else "") + words[1 if listed else 2]


def main() -> None:
    """Prints a line for each of the three."""
    with tempfile.TemporaryDirectory() as folder:
        grid, server = prepare(Path(folder), 2, 2), Server()
        with proxy_of(server) as proxy:
            place = {**server.environment(proxy.port), "STYLETRF_REMOTE": server.bucket().url}
            for name, store in (("built", "one"), ("fetched", "two"), ("found", "one")):
                own = {"STYLETRF_STORE": f"{folder}/{store}"}
                requests = requests_of(grid, proxy, place | own)
                print(f"{name}: {requests.total()} requests, {dict(requests)}", flush=True)  # noqa: T201
        server.kill()


if __name__ == "__main__":
    main()
