"""A viewer that looks are added to, and that saves the paths drawn in it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from threading import Lock
from typing import Any

from styletrf.errors import InputError
from styletrf.files.atomic_write import atomic_write
from styletrf.trajectory.key_frames import LONGEST_S, key_frames_of, write_key_frames
from styletrf.viewer.baking import BakedLook
from styletrf.viewer.viewer_content import ViewerContent
from styletrf.viewer.webpage.packed_scene import Packed, packed_look, packed_scene
from styletrf.viewer.webpage.viewer_page import encoded_page, viewer_page

Command = Callable[[dict[str, float], float], str]
"""Returns the command that renders a path, by the weights of paintings and its seconds."""


class LiveViewer:
    """The site of a `PageServer`: a scene and the looks that are baked so far."""

    def __init__(
        self,
        content: ViewerContent,
        thumbnails: Sequence[str],
        frames_per_second: float,
        file: Path,
        command: Command,
    ) -> None:
        """Creates the viewer with its first looks.

        Args:
            content: The scene with the look of its photographs, and further looks if there are any.
            thumbnails: The thumbnails of these looks, as `data:` URIs.
            frames_per_second: The rate of the fly-through.
            file: The file to which paths are saved.
            command: Returns the shell command that renders a saved path.
        """
        self._content, self._scene = content, packed_scene(content, frames_per_second)
        self._looks: Sequence[tuple[BakedLook, Packed]] = ()
        self._file, self._command, self.report = file, command, ""
        self._lock = Lock()
        for look, thumbnail in zip(content.looks, thumbnails, strict=True):
            self.add(look, thumbnail)

    def add(self, look: BakedLook, thumbnail: str) -> None:
        """Adds a look; pages that are open request it."""
        self._looks = (*self._looks, (look, packed_look(look, thumbnail)))

    def page(self) -> bytes:
        """Returns the page with all looks, in UTF-16."""
        looks = self._looks
        content = replace(self._content, looks=[look for look, _ in looks])
        packed = [packed for _, packed in looks]
        return encoded_page(viewer_page(content, self._scene, packed, is_live=True))

    def state(self) -> dict[str, Any]:
        """Returns the number of looks, and the report on the present work."""
        return {"looks": len(self._looks), "report": self.report}

    def look(self, number: int) -> dict[str, Any] | None:
        """Returns a look, None if it does not exist."""
        if number >= len(self._looks):
            return None
        packed = self._looks[number][1]
        return {"values": packed.values, "blocks": packed.blocks}

    def save(self, request: Any) -> dict[str, Any]:
        """Saves a path and returns its file, and the command that renders it.

        Args:
            request: The `path` as in docs/paths.md, its `seconds`, and the shown mixture: the looks
                `a` and `b` by number, and the `share` of the first.

        Raises:
            InputError: The request is not of this form; the error says where.
        """
        if not isinstance(request, dict) or not isinstance(request.get("path"), dict):
            raise InputError("the request", "has no path", "Load the page again")
        keys = key_frames_of(self._file, request["path"])
        seconds = _number(request, "seconds", LONGEST_S)
        share = _number(request, "share", 1)
        command = self._command(self._weights(request, share), seconds)
        self._file.parent.mkdir(parents=True, exist_ok=True)
        with self._lock, atomic_write(self._file) as partial:
            write_key_frames(partial, keys)
        return {"file": str(self._file), "command": command}

    def _weights(self, request: dict[str, Any], share: float) -> dict[str, float]:
        """Returns the paintings that are shown, with weights that are not 0."""
        weights: dict[str, float] = {}
        for letter, weight in (("a", round(share, 3)), ("b", round(1 - share, 3))):
            number = int(_number(request, letter, len(self._looks) - 1))
            if number > 0:  # the first are the photographs
                name = self._looks[number][0].name
                weights[name] = weights.get(name, 0.0) + weight
        return {name: weight for name, weight in weights.items() if weight > 0}


def _number(request: dict[str, Any], name: str, most: float) -> float:
    value: Any = request.get(name)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not math.isfinite(value) or not 0 <= value <= most:
        raise InputError(f"{name} {value!r}", f"is not a number from 0 to {most}", "Change it")
    return float(value)
