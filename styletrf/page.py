"""The parts of a page that stands alone: its frame, sections, folded tables, and sizes in words."""

import html
from collections.abc import Iterable, Mapping
from pathlib import Path
from string import Template

from styletrf.whole_files import whole_file

_TEMPLATE = Path(__file__).with_name("report_template.html")


def write_page(path: Path, title: str, sections: Iterable[str]) -> None:
    """Writes the page; the title is escaped, the sections are HTML, empty ones left out."""
    template = Template(_TEMPLATE.read_text(encoding="utf-8"))
    page = template.substitute(title=html.escape(title), body="\n".join(filter(None, sections)))
    with whole_file(path) as partial:
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
