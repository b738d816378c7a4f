"""Names of photographs in a capture: no two are the same, whatever folders and files are called.

Upper and lower case count as the same, since some file systems do not tell them apart.
"""

import os
import unicodedata
from collections.abc import Mapping, Sequence, Set
from itertools import count
from pathlib import Path

from styletrf.capture.capture_file import Photograph
from styletrf.capture.panorama.panorama_views import DIRECTIONS, view_name
from styletrf.errors import InputError

_MOST_BYTES = 200  # of the 255 that file systems allow: names of files made of it are longer


def stored_files(files: Sequence[Path]) -> list[str]:
    """Returns the names of files in one folder; with their folders' before them where any clash.

    Of a name of more than 200 bytes the end is left.
    """
    names = [file.name for file in files]
    if _clash(names):
        common = Path(os.path.commonpath(files))
        names = ["_".join(file.relative_to(common).parts) for file in files]
    return distinct([shortened(name) for name in names])


def shortened(name: str) -> str:
    """Returns the last 200 bytes of a name, or fewer where a character begins before them."""
    return name.encode()[-_MOST_BYTES:].decode(errors="ignore")


def composed(name: str) -> str:
    """Returns a name with each accent in one character with its letter (Unicode NFC).

    Keyboards type it so; macOS stores accents apart from their letters.
    """
    return unicodedata.normalize("NFC", name)


def photograph_names(stored: Sequence[str]) -> list[str]:
    """Returns the names of photographs: those of their files, without suffixes if none clash then.

    Args:
        stored: The result of `stored_files`.
    """
    stems = [Path(file).stem for file in stored]
    return list(stored) if _clash(stems) else stems


def distinct(names: Sequence[str]) -> list[str]:
    """Returns the names; a name that an earlier one has gets a number behind its stem."""
    taken, seen, found = {name.casefold() for name in names}, set[str](), []
    for name in names:
        own = _numbered(name, taken) if name.casefold() in seen else name
        seen.add(own.casefold())
        taken.add(own.casefold())
        found.append(own)
    return found


def views_of_panorama(name: str) -> list[str]:
    """Returns the names of the views that are cut from a panorama of this name."""
    return [view_name(name, direction) for direction in DIRECTIONS]


def require_own_names(photographs: Mapping[Path, Photograph], panoramas: Set[Path]) -> None:
    """Refuses a photograph that has the name of a view that is cut from a panorama.

    Args:
        photographs: The photographs by their files.
        panoramas: Those of the files that are cut.

    Raises:
        InputError: There is such a photograph.
    """
    views: dict[str, Path] = {}
    for panorama in panoramas:
        for view in views_of_panorama(photographs[panorama].name):
            views |= {view.casefold(): panorama, f"{view}.png".casefold(): panorama}
    for file in photographs.keys() - panoramas:
        names = {photographs[file].name.casefold(), photographs[file].file.casefold()}
        for same in names & views.keys():
            problem = f"has the name of a view that is cut from {views[same].name}"
            raise InputError(file.name, problem, "Rename it, or leave it out")


def _clash(names: Sequence[str]) -> bool:
    return len({name.casefold() for name in names}) < len(names)


def _numbered(name: str, taken: Set[str]) -> str:
    stem, suffix = Path(name).stem, Path(name).suffix
    numbered = (f"{stem}_{number}{suffix}" for number in count(2))
    return next(name for name in numbered if name.casefold() not in taken)
