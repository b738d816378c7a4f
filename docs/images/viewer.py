"""Shows a viewer as a desktop and, dark, as a phone sees it, in one picture; needs `chromium`.

python docs/images/viewer.py out/horns/viewer.html docs/images/viewer.jpg
python docs/images/viewer.py out/horns/viewer.html docs/images/camera_path.jpg path

With `path` it draws a camera path. The page may also be the address that `styletrf view` prints.
A picture is taken when the page has drawn its own in full.
"""

import asyncio
import base64
import json
import shutil
import subprocess
import sys
import tempfile
import urllib.request
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from tornado.websocket import WebSocketClientConnection, websocket_connect

DESKTOP, PHONE, GAP_PX = (1280, 900), (390, 900), 40
SPLIT = "shown.split = 0.5; refresh();"
DRAWN = """
  const find = (what) => document.querySelector(what);
  find("#route").open = true;
  for (const frame of [0, 0.15, 0.3, 0.45]) {
    navigation.follow(Math.floor(frame * navigation.frames));
    find("#addKey").click();
  }
  find("#keys [aria-label='Go to key frame 2']").click();
"""
LOOKED_AT = """viewer.then(async ({ loop, shown, refresh, navigation }) => {
  BEFORE
  while (!loop.isSettled()) await new Promise((r) => setTimeout(r, 100));
  await new Promise((r) => setTimeout(r, 500));
  return document.querySelector("#status").textContent;
})"""


async def asked(socket: WebSocketClientConnection, method: str, **words: Any) -> dict[str, Any]:
    """Returns the browser's answer to a command of its protocol."""
    await socket.write_message(json.dumps({"id": 1, "method": method, "params": words}))
    while True:
        answer = json.loads(await socket.read_message() or "{}")
        if answer.get("id") == 1:
            return dict(answer["result"])


async def picture_of(port: int, page: str, size: tuple[int, int], look: str, before: str) -> Any:
    """Returns the page's pixels, BGR."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
        address = next(t for t in json.load(answer) if t["type"] == "page")["webSocketDebuggerUrl"]
    socket = await websocket_connect(address, max_message_size=1 << 28)
    width, height = size
    await asked(socket, "Emulation.setDeviceMetricsOverride", width=width, height=height,
                deviceScaleFactor=1, mobile=False)  # fmt: skip
    scheme = {"name": "prefers-color-scheme", "value": look}
    await asked(socket, "Emulation.setEmulatedMedia", features=[scheme])
    await asked(socket, "Page.navigate", url=page)
    await asyncio.sleep(3)
    script = LOOKED_AT.replace("BEFORE", before)
    await asked(socket, "Runtime.evaluate", expression=script, awaitPromise=True)
    shot = await asked(socket, "Page.captureScreenshot")
    return cv2.imdecode(np.frombuffer(base64.b64decode(shot["data"]), np.uint8), cv2.IMREAD_COLOR)


def main() -> None:
    """Write the picture."""
    page, picture, port = sys.argv[1], sys.argv[2], 9347
    is_path = sys.argv[3:] == ["path"]
    if not page.startswith("http"):
        page = Path(page).absolute().as_uri()
    scripts = [DRAWN, DRAWN] if is_path else [SPLIT, ""]
    chromium = shutil.which("chromium") or "chromium"
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        flags = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "about:blank",
                 f"--user-data-dir={profile}", f"--remote-debugging-port={port}",
                 f"--remote-allow-origins=http://127.0.0.1:{port}"]  # fmt: skip
        browser = subprocess.Popen([chromium, *flags], stderr=subprocess.DEVNULL)
        try:
            asyncio.run(asyncio.sleep(5))
            seen = [
                asyncio.run(picture_of(port, page, size, scheme, script))
                for size, scheme, script in zip(
                    (DESKTOP, PHONE), ("light", "dark"), scripts, strict=True
                )
            ]
        finally:
            browser.terminate()
            browser.wait()
    gap = np.full((DESKTOP[1], GAP_PX, 3), 255, np.uint8)
    cv2.imwrite(picture, np.hstack([seen[0], gap, seen[1]]), [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main()
