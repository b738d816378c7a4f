"""A report shows the viewer of its scene within itself, at its own painting."""

import numpy as np
import pytest
from headless import needs_chromium
from served_folder import served_folder
from shared_browser import opened
from written_viewers import written_small

from styletrf.files.images import write_rgb
from styletrf.reports.report import ReportContent, write_report

pytestmark = needs_chromium
ENTERED = """
  await until(() => document.querySelector(".enter")?.checkVisibility());
  document.querySelector(".enter").click();
  const inside = document.querySelector("iframe").contentWindow;
  await until(() => inside.viewer && inside.document.querySelector("#notice").hidden);
  const { scene, chosen, loop } = await inside.viewer;
  await until(() => loop.isSettled());
  const canvas = inside.document.querySelector("canvas");
  return { painting: scene.looks[chosen.a].name, wide: canvas.clientWidth,
           over: inside.document.documentElement.scrollWidth - inside.innerWidth };
"""


@pytest.mark.parametrize("width", [1000, 390])
def test_a_report_opens_its_viewer_at_its_painting(content, tmp_path, width):
    place = tmp_path / "the yard/style 2"
    place.mkdir(parents=True)
    content_of_report = ReportContent("the yard", "style 2", "draft", viewer_command="luigi")
    write_report(place / "report.html", content_of_report)
    written_small(content("ndc"), place.with_name("viewer.html"))
    write_rgb(place.with_name("viewer.style 2.jpg"), np.full((8, 8, 3), 0.5, np.float32))
    report = "the%20yard/style%202/report.html"
    with served_folder(tmp_path) as address, opened(f"{address}/{report}", width) as page:
        answer = page.run(ENTERED)
        assert page.errors == []
    assert answer["painting"] == "style 2"
    assert answer["wide"] > width / 2
    assert answer["over"] <= 0
