"""Shows a viewer as a desktop and, dark, as a phone sees it, in one picture; needs `chromium`.

python docs/images/viewer.py out/horns/viewer.html docs/images/viewer.jpg
python docs/images/viewer.py out/horns/viewer.html docs/images/camera_path.jpg path

With `path` it draws a camera path. The page may also be the address that `styletrf view` prints.
A picture is taken when the page has drawn its own in full.
"""

import base64
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests/support"))
from headless import opened  # type: ignore[import-not-found]

DESKTOP_PX, PHONE_PX, GAP_PX = 1280, 390, 40
SPLIT = "chosen.split = 0.5; refresh();"
DRAWN = """
  const find = (what) => document.querySelector(what);
  find("#route").open = true;
  for (const frame of [0, 0.15, 0.3, 0.45]) {
    navigation.follow(Math.floor(frame * navigation.frames));
    find("#addKey").click();
  }
  find("#keys [aria-label='Go to key frame 2']").click();
"""
LOOKED_AT = """
  const { loop, chosen, refresh, navigation } = await viewer;
  BEFORE
  await until(() => loop.isFinished());
  await new Promise((r) => setTimeout(r, 500));
"""


def picture_of(address: str, width: int, scheme: str, before: str) -> Any:
    """Returns the page's pixels, BGR, after a script ran in it."""
    with opened(address, width) as page:
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        page.command("Emulation.setEmulatedMedia", features=features)
        page.run(LOOKED_AT.replace("BEFORE", before))
        shot = base64.b64decode(page.command("Page.captureScreenshot")["data"])
    return cv2.imdecode(np.frombuffer(shot, np.uint8), cv2.IMREAD_COLOR)


def main() -> None:
    """Write the picture."""
    page, picture = sys.argv[1:3]
    is_path = sys.argv[3:] == ["path"]
    if not page.startswith("http"):
        page = Path(page).absolute().as_uri()
    desktop = picture_of(page, DESKTOP_PX, "light", DRAWN if is_path else SPLIT)
    phone = picture_of(page, PHONE_PX, "dark", DRAWN if is_path else "")
    gap = np.full((len(desktop), GAP_PX, 3), 255, np.uint8)
    cv2.imwrite(picture, np.hstack([desktop, gap, phone]), [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main()
