"""Photographs and frames of clips that are left out, by names, paths or patterns."""

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from styletrf.capture.photograph_names import composed, photograph_names, stored_files
from styletrf.capture.photographs import path_below
from styletrf.errors import InputError

_MOST_NAMES = 10


@dataclass(frozen=True, slots=True)
class PhotographNames:
    """The names of a photograph: that in the capture, those of its file, and its paths."""

    name: str
    of_file: frozenset[str] = frozenset()
    paths: frozenset[str] = frozenset()

    def matches(self, pattern: str) -> bool:
        """Returns whether any of them matches a pattern such as `IMG_00*`."""
        return any(fnmatchcase(name, pattern) for name in (self.name, *self.of_file, *self.paths))

    @property
    def in_nfc(self) -> "PhotographNames":
        """The same names with each accent in one character with its letter (Unicode NFC)."""
        of_file, paths = (frozenset(map(composed, one)) for one in (self.of_file, self.paths))
        return PhotographNames(composed(self.name), of_file, paths)


def without(folder: Path, files: Sequence[Path], leave_out: Sequence[str]) -> list[Path]:
    """Returns the photographs that are not left out.

    Args:
        folder: The folder of the photographs, to which paths are relative.
        files: All of them.
        leave_out: See `left_out`. Names and paths are with the suffix or without.

    Raises:
        InputError: No photograph has such a name.
    """
    names = photograph_names(stored_files(files))
    known = [_names_of(folder, file, name) for file, name in zip(files, names, strict=True)]
    indices = left_out(leave_out, known)
    return [file for index, file in enumerate(files) if index not in indices]


def left_out(leave_out: Sequence[str], known: Sequence[PhotographNames]) -> set[int]:
    """Returns the indices of the photographs that are left out.

    Args:
        leave_out: Each is a name in the capture; or else the name of a file, of one or several; or
            else a path; or else a pattern.
        known: The names of all photographs, or of all frames.

    Raises:
        InputError: No photograph has such a name.
    """
    typed = [one.in_nfc for one in known]
    return {index for asked in leave_out for index in _indices(composed(asked), typed)}


def _indices(asked: str, known: Sequence[PhotographNames]) -> list[int]:
    captured = [asked == one.name for one in known]
    named = [asked in one.of_file for one in known]
    placed = [asked in one.paths for one in known]
    alike = [one.matches(asked) for one in known]
    for found in (captured, named, placed, alike):
        if any(found):
            return [index for index, is_meant in enumerate(found) if is_meant]
    more = ", ..." if len(known) > _MOST_NAMES else ""
    names = ", ".join(one.name for one in known[:_MOST_NAMES]) + more
    problem = "is to be left out, and nothing has such a name"
    raise InputError(f"leave_out {asked!r}", problem, f"The names are {names}")


def names_of_frame(name: str) -> PhotographNames:
    """Returns the names of a frame of a clip, from that in the capture."""
    return PhotographNames(name, frozenset([f"{name}.png"]))


def _names_of(folder: Path, file: Path, name: str) -> PhotographNames:
    path = path_below(folder, file)
    paths = frozenset([path.as_posix(), path.with_suffix("").as_posix()])
    return PhotographNames(name, frozenset([file.name, file.stem]), paths)
