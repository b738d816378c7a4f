"""Shows a page as a desktop and, dark, as a phone sees it, in one picture; needs `chromium`.

python docs/images/screenshot.py out/horns/mediter/report.html docs/images/report.jpg
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2

DESKTOP_PX, PHONE_PX, HEIGHT_PX, GAP_PX = 1280, 390, 1080, 40
FRAMES = """<body style="margin:0;display:flex;gap:{gap}px;background:#fff">
<iframe src="{page}" style="width:{desktop}px;height:{height}px;border:0"></iframe>
<iframe src="{page}" style="width:{phone}px;height:{height}px;border:0;color-scheme:dark"></iframe>
"""


def main() -> None:
    """Write the picture."""
    chromium = shutil.which("chromium") or "chromium"
    page, picture = Path(sys.argv[1]).absolute().as_uri(), sys.argv[2]
    width = DESKTOP_PX + GAP_PX + PHONE_PX
    frames = FRAMES.format(
        page=page, desktop=DESKTOP_PX, phone=PHONE_PX, height=HEIGHT_PX, gap=GAP_PX
    )
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "frames.html").write_text(frames)
        subprocess.run(
            [chromium, "--headless", "--no-sandbox", "--hide-scrollbars", "--timeout=5000",
             "--disable-gpu", f"--user-data-dir={folder}/profile",
             f"--window-size={width},{HEIGHT_PX}", f"--screenshot={folder}/seen.png",
             (Path(folder) / "frames.html").as_uri()],
            check=True, capture_output=True,
        )  # fmt: skip
        seen = cv2.imread(f"{folder}/seen.png")
    cv2.imwrite(picture, seen[:HEIGHT_PX], [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main()
