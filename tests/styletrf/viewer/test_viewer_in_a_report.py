"""A report shows the viewer of its scene within itself, at its own painting."""

import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest
from headless import needs_chromium, opened
from written_viewers import written

from styletrf.files.images import write_rgb
from styletrf.reports.report import ReportContent, write_report

pytestmark = needs_chromium
ENTERED = """
  await until(() => document.querySelector(".enter")?.checkVisibility());
  document.querySelector(".enter").click();
  const inside = document.querySelector("iframe").contentWindow;
  await until(() => inside.viewer && inside.document.querySelector("#notice").hidden);
  const { scene, shown, loop } = await inside.viewer;
  await until(() => loop.isSettled());
  const canvas = inside.document.querySelector("canvas");
  return { painting: scene.looks[shown.a].name, wide: canvas.clientWidth,
           over: inside.document.documentElement.scrollWidth - inside.innerWidth };
"""


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.mark.parametrize("width", [1000, 390])
def test_a_report_opens_its_viewer_at_its_painting(content, tmp_path, width):
    place = tmp_path / "the yard/style 2"
    place.mkdir(parents=True)
    report = ReportContent("the yard", "style 2", "draft", viewer_command="luigi")
    write_report(place / "report.html", report)
    written(content("ndc"), place.with_name("viewer.html"))
    write_rgb(place.with_name("viewer.style 2.jpg"), np.full((8, 8, 3), 0.5, np.float32))
    (tmp_path / "favicon.ico").touch()  # which a browser asks every server for
    handler = partial(Quiet, directory=tmp_path)
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever).start()
        address = f"http://127.0.0.1:{server.server_address[1]}/the%20yard/style%202/report.html"
        try:
            with opened(address, width) as page:
                answer = page.run(ENTERED)
                assert page.errors == []
        finally:
            server.shutdown()
    assert answer["painting"] == "style 2"
    assert answer["wide"] > width / 2
    assert answer["over"] <= 0
