"""Optional dependencies: their versions are part of the key, absent ones are errors.

Neither torch nor the packages themselves are imported for this.
"""

import os
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from styletrf.errors import InputError
from styletrf.files.published_weights import ALEXNET, RAFT
from tasks.machine.digest_cache import cached_digests

EXPORT_PACKAGES = {
    "ply": ("gsply",),
    "spz": ("gsply",),
    "points": ("trimesh",),
    "mesh": ("scikit-image", "trimesh"),
    "blender": ("scikit-image", "trimesh"),
    "cameras": (),
}
"""The packages that write the files of each format of `Export`."""
_EXPORT_REMEDY = "Install its extra: pip install 'styletrf[export]'"


def lpips_digests() -> dict[str, str]:
    """Returns the releases of lpips and torchvision, and the digest of AlexNet's weights.

    Raises:
        InputError: One of them is missing.
    """
    return _digests("LPIPS", ("lpips", "torchvision"), ALEXNET)


def raft_digests() -> dict[str, str]:
    """Returns the release of torchvision and the digest of RAFT's weights.

    Raises:
        InputError: One of them is missing.
    """
    return _digests("flow raft", ("torchvision",), RAFT)


def export_versions(file_format: str) -> dict[str, str]:
    """Returns the releases of the packages that write an export's files.

    Raises:
        InputError: One of them is not installed.
    """
    try:
        return {package: version(package) for package in EXPORT_PACKAGES[file_format]}
    except PackageNotFoundError as error:
        problem = f"needs the package {error.name}, which is not installed"
        raise InputError(f"--format {file_format}", problem, _EXPORT_REMEDY) from error


def _digests(what: str, packages: tuple[str, ...], weights: str) -> dict[str, str]:
    path = _downloads() / weights
    try:
        versions = {package: version(package) for package in packages}
    except PackageNotFoundError as error:
        problem = f"needs the package {error.name}, which is not installed"
        raise InputError(what, problem, "Install it, or leave that out") from error
    if not path.is_file():
        problem = "is not there: weights that torchvision publishes"
        raise InputError(f"{path} for {what}", problem, "Fetch them there, or leave that out")
    return {**versions, **cached_digests({weights: path})}


def _downloads() -> Path:
    """Returns the folder of torch's downloads, which the environment decides, as in torch.hub."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    home = os.environ.get("TORCH_HOME") or Path(cache, "torch")
    return Path(home, "hub", "checkpoints")
