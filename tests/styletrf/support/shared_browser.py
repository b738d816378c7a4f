"""Pages one after another in a browser that stays open, as it takes longer to start than they."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import headless
from headless import OpenPage

OVERFLOW = """
const overflow = () => document.documentElement.scrollWidth - document.documentElement.clientWidth;
"""
_browsers: dict[int, tuple[ExitStack, OpenPage]] = {}


@contextmanager
def opened(address: str, width: int = 1000) -> Iterator[OpenPage]:
    """As `headless.opened`; at most one page of a width is open at a time."""
    if width not in _browsers:
        stack = ExitStack()
        _browsers[width] = stack, stack.enter_context(headless.opened("about:blank", width))
    page = _browsers[width][1]
    try:
        page.run("")  # reads what the page before it logged last
        page.errors.clear()
        page.command("Page.navigate", url=address)
        page.run("await until(() => document.readyState === 'complete');")
        yield page
        page.command("Page.navigate", url="about:blank")  # else it would go on drawing
    except BaseException:  # whatever it did to the browser, the next test has another one
        _browsers.pop(width)[0].close()
        raise


def answer_of(page: Path, probe: str, width: int) -> dict[str, Any]:
    """Returns what the body of an async function returns in the page, with `errors`.

    It may call `until(holds)` and `overflow()`.
    """
    with opened(page.as_uri(), width) as shown:
        answer = shown.run(OVERFLOW + probe)
        return {**answer, "errors": list(shown.errors)}


def close_browsers() -> None:
    """Closes the browsers that are open."""
    while _browsers:
        _browsers.popitem()[1][0].close()
