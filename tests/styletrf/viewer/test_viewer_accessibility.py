"""The page can be read in light and dark, and used without a mouse and without seeing it."""

from collections.abc import Iterator

import pytest
from headless import OpenPage, needs_chromium, opened
from written_viewers import written

pytestmark = needs_chromium
LEAST_CONTRAST = 4.5
"""Of text, by WCAG 2.2, criterion 1.4.3."""


@pytest.fixture(scope="module")
def page(content, tmp_path_factory) -> Iterator[OpenPage]:
    written_page = written(content("ndc"), tmp_path_factory.mktemp("viewer") / "viewer.html")
    with opened(written_page.as_uri()) as shown:
        shown.run(
            "await viewer; for (const e of document.querySelectorAll('details')) e.open = true;"
            "document.querySelector('#halve').click();"
        )
        yield shown
        assert shown.errors == []


CONTRASTS = """
  const numbers = (color) => color.match(/[\\d.]+/g).map(Number);
  const light = (color) => {
    const [r, g, b] = color.map((v) => v / 255)
      .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const over = (color, under) => {
    const [r, g, b, opaque = 1] = numbers(color);
    return [r, g, b].map((v, k) => opaque * v + (1 - opaque) * under[k]);
  };
  const behind = (element, picture) => {  // which may have any color
    const under = element.id === "stage" || !element.parentElement
      ? picture : behind(element.parentElement, picture);
    return over(getComputedStyle(element).backgroundColor, under);
  };
  const hasText = (element) => [...element.childNodes].some(
    (node) => node.nodeType === Node.TEXT_NODE && node.textContent.trim());
  const found = [];
  for (const element of document.querySelectorAll("main *")) {
    if (!hasText(element) || !element.getClientRects().length || element.disabled) continue;
    for (const picture of [[0, 0, 0], [255, 255, 255]]) {
      const under = behind(element, picture), text = over(getComputedStyle(element).color, under);
      const [dark, bright] = [light(text), light(under)].sort((a, b) => a - b);
      const name = `${element.tagName} ${element.id} ${element.textContent}`;
      found.push([name, (bright + 0.05) / (dark + 0.05)]);
    }
  }
  return { found, page: light(numbers(getComputedStyle(document.body).backgroundColor)) };
"""


@pytest.mark.parametrize(("scheme", "is_dark"), [("light", False), ("dark", True)])
def test_text_is_readable_in_light_and_dark(page, scheme, is_dark):
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    page.command("Emulation.setEmulatedMedia", features=features)
    answer = page.run(CONTRASTS)
    assert (answer["page"] < 0.5) == is_dark
    texts = " ".join(name for name, _ in answer["found"])
    for shown in ("SPAN left", "SPAN right", "BUTTON play", "SUMMARY", "TH", "TD", "P status"):
        assert shown in texts
    assert [each for each in answer["found"] if each[1] < LEAST_CONTRAST] == []


def test_every_control_has_a_name_for_screen_readers(page):
    page.command("Accessibility.enable")
    nodes = page.command("Accessibility.getFullAXTree")["nodes"]
    controls = {"button", "radio", "slider", "combobox", "spinbutton", "checkbox", "image"}
    named = [
        (node["role"]["value"], node.get("name", {}).get("value", ""))
        for node in nodes
        if not node["ignored"] and node["role"]["value"] in controls
    ]
    assert {role for role, _ in named} >= controls - {"image"}
    assert [role for role, name in named if not name.strip()] == []


def test_the_keyboard_reaches_every_control(page):
    focusable = """
      const all = [...document.querySelectorAll("canvas, button, input, select, summary")];
      const isShown = (e) => e.getClientRects().length && !e.disabled && e.type !== "radio";
      return all.filter(isShown).map((e) => e.id || e.textContent);
    """
    expected, reached = set(page.run(focusable)), set()
    page.run("document.activeElement.blur();")
    for _ in range(len(expected) + 5):
        for kind in ("keyDown", "keyUp"):
            page.command("Input.dispatchKeyEvent", type=kind, key="Tab", code="Tab",
                         windowsVirtualKeyCode=9)  # fmt: skip
        reached.add(page.run("const e = document.activeElement; return e.id || e.textContent;"))
    assert expected <= reached
