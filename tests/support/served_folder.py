"""A folder over HTTP, for pages that a file's address would keep apart."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import ClassVar


class _Handler(SimpleHTTPRequestHandler):
    extensions_map: ClassVar = {".html": "text/html; charset=utf-8", ".jpg": "image/jpeg"}

    def log_message(self, *_):
        pass


@contextmanager
def served_folder(folder: Path) -> Iterator[str]:
    """Yields the address of a folder whose pages are said to be in UTF-8."""
    (folder / "favicon.ico").touch()  # which a browser asks every server for
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(_Handler, directory=folder)) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}"
        finally:  # else a test that fails would keep its process from ending
            server.shutdown()
            thread.join()
