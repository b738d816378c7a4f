"""An artifact as one stream of bytes: an uncompressed tar, the same for the same content."""

import shutil
import tarfile
from pathlib import Path, PurePosixPath

from pipeline.digest import Tree, walk


def pack(root: Path, archive: Path) -> None:
    """Write all that the directory `root` holds into the new tar file `archive`.

    Names and bytes decide its bytes: sorted, without times, owners and modes.
    """
    with tarfile.open(archive, "x", format=tarfile.PAX_FORMAT) as tar:
        for path, status in walk(root):
            member = tarfile.TarInfo(path.relative_to(root).as_posix())
            if path.is_dir():
                member.type = tarfile.DIRTYPE
                tar.addfile(member)
            else:
                member.size = status.st_size
                with path.open("rb") as file:
                    tar.addfile(member, file)


def unpack(archive: Path, root: Path, expected: Tree) -> None:
    """Make the directory `root` from what `pack` wrote; nothing is ever written outside it.

    Raises:
        ValueError: When the archive is damaged, has not the size expected, or holds a device or
            what leads elsewhere. What it made until then stays.
    """
    root.mkdir()
    try:
        with tarfile.open(archive, "r:") as tar:
            files = [member.size for member in tar.getmembers() if member.isfile()]
            if (sum(files), len(files)) != (expected.size, expected.files):
                raise ValueError("its files are not of the expected number and size")
            for member in tar:
                _extract(tar, member, root)
    except (tarfile.TarError, FileExistsError, FileNotFoundError, NotADirectoryError) as error:
        raise ValueError(f"it is no archive of an artifact: {error}") from error


def _extract(tar: tarfile.TarFile, member: tarfile.TarInfo, root: Path) -> None:
    """Make one directory or file; Python has a filter for that from 3.11.4 on only.

    Links are never made, so that a name without `..` cannot lead elsewhere.
    """
    name = PurePosixPath(member.name)
    if name.is_absolute() or ".." in name.parts:
        raise ValueError(f"{member.name} leads elsewhere")
    content = tar.extractfile(member) if member.isreg() else None
    if content:
        with content, (root / name).open("xb") as file:
            shutil.copyfileobj(content, file)
    elif member.isdir():
        (root / name).mkdir()
    else:
        raise ValueError(f"{member.name} is neither a file nor a directory")
