"""What the user sets: `luigi.cfg`, and the environment variables that win over it."""

import configparser
import functools
import os
from pathlib import Path

import luigi

from pipeline.errors import StoreError
from pipeline.store import Store, open_store

_DEFAULTS = {
    ("store", "root"): "store",  # STYLETRF_STORE wins
    ("store", "salt"): "",  # another word disowns all artifacts
    ("store", "remote"): "",  # the shared store's path or URL, if any; STYLETRF_REMOTE wins
    ("store", "remote_options"): "{}",  # JSON, for fsspec's file system
    ("store", "patience_seconds"): "0",  # for a shared store that fails; STYLETRF_PATIENCE wins
    ("store", "signing_key"): "",  # a file; what is shared is signed by it, and has to be
    ("store", "push"): "true",  # whether what a run builds is uploaded to the shared store
    ("store", "identity"): "tasks/identity.json",  # the snapshot of the code, with adoptions
    ("store", "checkpoint_seconds"): "60",  # between uploads of checkpoints; 0: none are shared
    ("store", "executor"): "subprocess",  # "inline" builds in this process, for tests
    ("store", "locks"): "true",  # whether one process at a time builds a key
    ("store", "memory_gib"): "0",  # at which a build is ended, if not 0
    ("store", "retry_seconds"): "10",  # before a second attempt at what may pass; then 4 times that
    ("gpu", "cards"): "",  # UUIDs; those that `nvidia-smi -L` names where this is empty
    ("host", "leases"): "/dev/shm/styletrf",  # noqa: S108  for all users; never swept
    ("host", "memory_gib"): "0",  # what builds may take together; 0: nine tenths of the host's
    ("host", "cores"): "2",  # that a build on another machine asks for
    ("ray", "address"): "",  # of the cluster's head; the one on this machine where this is empty
    ("slurm", "options"): "",  # further words for sbatch
    ("grid", "webhook"): "",  # an address to which the summary of a grid is posted, as JSON
    ("night", "webhook"): "",  # its name in earlier versions
    ("data", "root"): "data",  # STYLETRF_DATA wins
    ("out", "root"): "out",  # STYLETRF_OUT wins
}


def setting(section: str, name: str) -> str:
    """A word from `luigi.cfg`, or the default."""
    config = luigi.configuration.get_config()  # type: ignore[no-untyped-call]
    return str(config.get(section, name, _DEFAULTS[section, name]))


def current_store(*, create: bool = True) -> Store:
    """The store in STYLETRF_STORE, or in [store] root of `luigi.cfg`, or in ./store.

    Raises:
        StoreError: When there is none and it cannot be made, or shall not.
    """
    root = _place("STYLETRF_STORE", "store")
    if not create and not (root / "format").is_file():
        raise StoreError(f"there is no store at {root}")
    return open_store(root)


def data_root() -> Path:
    """The user's data: STYLETRF_DATA, or [data] root of `luigi.cfg`, or ./data."""
    return _place("STYLETRF_DATA", "data")


def out_root() -> Path:
    """Where results are shown: STYLETRF_OUT, or [out] root of `luigi.cfg`, or ./out."""
    return _place("STYLETRF_OUT", "out")


def _place(variable: str, section: str) -> Path:
    """The folder in an environment variable, or in `root` of a section."""
    folder = os.environ.get(variable)
    return (Path(folder) if folder else configured_path(section, "root")).absolute()


def configured_path(section: str, name: str) -> Path:
    """A path in the settings; a relative one starts at the folder of the file that names it."""
    other = os.environ.get("LUIGI_CONFIG_PATH")
    folder = Path(other).parent if other and _defines(other, section, name) else Path()
    return folder / setting(section, name)


@functools.cache
def _defines(file: str, section: str, name: str) -> bool:
    config = configparser.ConfigParser(interpolation=None, strict=False)
    return bool(config.read(file)) and config.has_option(section, name)
