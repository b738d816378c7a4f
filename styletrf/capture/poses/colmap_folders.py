"""The folders in which a scene's COLMAP models lie: `sparse/0`, `sparse/1` and so on."""

from pathlib import Path

_PLACES = ("sparse/[0-9]*", "sparse", "colmap/sparse/[0-9]*")


def colmap_folders(folder: Path) -> list[Path]:
    """Returns the folders of the models of a scene; of several places, those of the first."""
    places = (_models(folder, pattern) for pattern in _PLACES)
    return next((found for found in places if found), [])


def colmap_files(folder: Path) -> list[Path]:
    """Returns the files of all models of a scene, also behind links."""
    files = (file for model in colmap_folders(folder) for file in sorted(model.glob("*.*")))
    return [file for file in files if file.is_file()]


def _models(folder: Path, pattern: str) -> list[Path]:
    """Returns the folders of models that match a pattern; a name such as `0_old` is no model's."""
    return [
        place
        for place in sorted(folder.glob(pattern))
        if (place.name.isdecimal() or place.name == pattern) and any(place.glob("cameras.*"))
    ]
