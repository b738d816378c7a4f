"""The part of a report that opens the viewer beside it, or shows the command that makes one.

A report is made once, and viewers come and go, so the page itself looks whether there is one: by
the picture that a viewer leaves for each of its styles, `SCENE/viewer.STYLE.jpg`.
"""

import html
from pathlib import Path
from urllib.parse import quote

from styletrf.reports.page import section

STYLE = Path(__file__).with_name("report_viewer.css").read_text(encoding="utf-8")
SCRIPT = Path(__file__).with_name("report_viewer.js").read_text(encoding="utf-8")
LINK = '<p><a href="#walk">Walk around in it</a></p>'
"""The link to the section."""


def viewer_part(style: str, command: str) -> str:
    """Returns the section as HTML; nothing without a command.

    The page that holds it needs `STYLE` and `SCRIPT`, and lies in `SCENE/STYLE/`.

    Args:
        style: The name of the style.
        command: Makes the viewer.
    """
    if not command:
        return ""
    name = html.escape(quote(style, safe=""))
    body = (
        f'<div class="walk" data-picture="../viewer.{name}.jpg"><p class="there">'
        f'<a href="../viewer.html#style={name}">Open the viewer beside this report</a>, '
        "if it was made.</p>"
        '<div class="absent"><p class="quiet small">This makes the viewer, a page of its own. '
        "It shows every style in the list:</p>"
        f'<div class="card"><pre>{html.escape(command)}</pre></div></div></div>'
    )
    return section('<span id="walk">Walk around in it</span>', body)
