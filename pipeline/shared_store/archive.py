"""An artifact as one file: an uncompressed tar, which is the same for the same content."""

import shutil
import tarfile
from pathlib import Path, PurePosixPath

from pipeline.digest import Tree, entries_below


def pack(root: Path, archive: Path) -> None:
    """Writes the content of the directory `root` into the new tar file `archive`.

    Its bytes depend only on sorted names and contents, not on times, owners and modes.
    """
    with tarfile.open(archive, "x", format=tarfile.PAX_FORMAT) as tar:
        for path, status in entries_below(root):
            member = tarfile.TarInfo(path.relative_to(root).as_posix())
            if path.is_dir():
                member.type = tarfile.DIRTYPE
                tar.addfile(member)
            else:
                member.size = status.st_size
                with path.open("rb") as file:
                    tar.addfile(member, file)


def unpack(archive: Path, root: Path, expected: Tree) -> None:
    """Makes the directory `root` from a file of `pack`, and never writes outside of it.

    Raises:
        ValueError: The archive is damaged, has another size than expected, or contains a device,
            a link or a path outside `root`. Files that were already unpacked stay.
    """
    root.mkdir()
    try:
        with tarfile.open(archive, "r:") as tar:
            files = [member.size for member in tar.getmembers() if member.isfile()]
            if (sum(files), len(files)) != (expected.size, expected.files):
                raise ValueError("its files do not have the expected number and size")
            for member in tar:
                _extract(tar, member, root)
    except (tarfile.TarError, FileExistsError, FileNotFoundError, NotADirectoryError) as error:
        raise ValueError(f"it is not an archive of an artifact: {error}") from error


def _extract(tar: tarfile.TarFile, member: tarfile.TarInfo, root: Path) -> None:
    """Makes one directory or file; Python's own filter exists only since 3.11.4.

    It never makes links, so a name without `..` stays inside `root`.
    """
    name = PurePosixPath(member.name)
    if name.is_absolute() or ".." in name.parts:
        raise ValueError(f"{member.name} is a path outside the artifact")
    content = tar.extractfile(member) if member.isreg() else None
    if content:
        with content, (root / name).open("xb") as file:
            shutil.copyfileobj(content, file)
    elif member.isdir():
        (root / name).mkdir()
    else:
        raise ValueError(f"{member.name} is neither a file nor a directory")
