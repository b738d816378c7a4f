"""The parts of a page that stands alone: its frame, sections, folded tables, and sizes in words."""

import html
from collections.abc import Iterable, Mapping
from pathlib import Path
from string import Template

from styletrf.files.atomic_write import atomic_write

_TEMPLATE = Path(__file__).with_name("page_template.html")


def write_page(
    path: Path, title: str, sections: Iterable[str], style: str = "", script: str = ""
) -> None:
    """Writes the page; the title is escaped, the sections are HTML, empty ones left out.

    Args:
        path: The file to write; an earlier page stays until the new one is whole.
        title: The title in the browser's tab.
        sections: The sections of the page.
        style: CSS besides that of all pages.
        script: JavaScript, run when all sections are there.
    """
    page = Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(
        title=html.escape(title),
        style=style,
        body="\n".join(filter(None, sections)),
        script=f"<script>\n{script}</script>" if script else "",
    )
    with atomic_write(path) as partial:
        partial.write_text(page, encoding="utf-8", newline="\n")


def section(title: str, body: str) -> str:
    """Returns a section under a title; nothing where the body is empty."""
    return f"<section>\n<h2>{title}</h2>\n{body}\n</section>" if body else ""


def folded_table(title: str, values: Mapping[str, object]) -> str:
    """Returns names and values that open on a click."""
    rows = "".join(
        f'<tr><th scope="row">{html.escape(name)}</th>'
        f"<td><code>{html.escape(str(value))}</code></td></tr>"
        for name, value in values.items()
    )
    table = f"<table><tbody>{rows}</tbody></table>"
    return f"<details><summary>{html.escape(title)}</summary>{table}</details>"


def duration(seconds: float | int) -> str:
    """Returns seconds as people say them: `8.3 s`, `2 min 05 s`, `1 h 03 min`."""
    if seconds < 59.95:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    return f"{minutes // 60} h {minutes % 60:02d} min"


def gibibytes(n_bytes: int) -> str:
    """Returns bytes as `1.25 GiB`."""
    return f"{n_bytes / 2**30:.2f} GiB"


def megabytes(n_bytes: int) -> str:
    """Returns bytes as `1.3 MB`; small files are 0.1 MB at least."""
    return f"{max(n_bytes / 1e6, 0.1):.1f} MB"
