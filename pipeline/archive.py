"""An artifact as one stream of bytes: an uncompressed tar, the same for the same content."""

import tarfile
from pathlib import Path

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
            tar.extractall(root, filter="data")
    except (tarfile.TarError, FileExistsError, FileNotFoundError, NotADirectoryError) as error:
        raise ValueError(f"it is no archive of an artifact: {error}") from error
