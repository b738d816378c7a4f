"""The user's settings: `luigi.cfg`, and the environment variables that take precedence."""

import configparser
import contextlib
import functools
import math
import os
from pathlib import Path

import luigi

from pipeline.errors import StoreError
from pipeline.store import Store, open_store

DEFAULTS = {
    ("store", "root"): "store",  # STYLETRF_STORE takes precedence
    ("store", "salt"): "",  # another word invalidates all artifacts
    ("store", "remote"): "",  # path or URL of the shared store; STYLETRF_REMOTE takes precedence
    ("store", "remote_options"): "{}",  # JSON, for fsspec's file system
    ("store", "patience_seconds"): "0",  # retries if the shared store fails; see STYLETRF_PATIENCE
    ("store", "signing_key"): "",  # the file of the key that signs shared records
    ("store", "push"): "true",  # whether builds are uploaded to the shared store
    # the snapshot of the code, with adoptions; it lies beside the code, installed or not
    ("store", "identity"): str(Path(__file__).parents[1] / "tasks/identity.json"),
    ("store", "checkpoint_seconds"): "60",  # between uploads of checkpoints; 0: no uploads
    ("store", "executor"): "subprocess",  # "inline" builds in this process, for tests
    ("store", "locks"): "true",  # whether one process at a time builds a key
    ("store", "memory_gib"): "0",  # memory at which a build is ended; 0: no limit
    ("store", "retry_seconds"): "10",  # before a second attempt; 4 times that before a third
    ("gpu", "uuids"): "",  # of the GPUs for builds; empty: all that `nvidia-smi -L` lists
    ("gpu", "cards"): "",  # its name in earlier versions
    ("host", "leases"): "/dev/shm/styletrf",  # noqa: S108  STYLETRF_LEASES takes precedence
    ("host", "memory_gib"): "0",  # for all builds together; 0: nine tenths of the host's
    ("host", "cores"): "2",  # number that a build on another machine requests
    ("ray", "address"): "",  # of the head of the cluster; empty: the one on this machine
    ("slurm", "options"): "",  # additional options of sbatch
    ("grid", "webhook"): "",  # an address to which the summary of a grid is posted, as JSON
    ("night", "webhook"): "",  # its name in earlier versions
    ("data", "root"): "data",  # STYLETRF_DATA takes precedence
    ("out", "root"): "out",  # STYLETRF_OUT takes precedence
}
"""The settings by section and name. A number or boolean has a default of its kind."""
BOOLEANS = configparser.ConfigParser.BOOLEAN_STATES


def setting(section: str, name: str) -> str:
    """Returns a setting or its default; a StoreError does not contain it, as it may be secret."""
    config = luigi.configuration.get_config()  # type: ignore[no-untyped-call]
    try:
        return str(config.get(section, name, DEFAULTS[section, name]))
    except configparser.InterpolationError:
        place = f"[{section}] {name} in {_file_of(section, name)}"
        raise StoreError(f"{place} has a % or ${{}} without a meaning. Write %% for %.") from None


def number_setting(section: str, name: str) -> float:
    """Returns a setting that is a number of 0 or more; a StoreError says that it is not."""
    if (number := nonnegative_number(setting(section, name))) is None:
        raise invalid_setting(section, name, "a number of 0 or more")
    return number


def nonnegative_number(text: str) -> float | None:
    """Returns the finite number of 0 or more that a text is; None if it is not one."""
    with contextlib.suppress(ValueError):
        if 0 <= (number := float(text)) < math.inf:
            return number
    return None


def boolean_setting(section: str, name: str) -> bool:
    """Returns whether a setting is true; a StoreError says that it is neither true nor false."""
    with contextlib.suppress(KeyError):
        return BOOLEANS[setting(section, name).lower()]
    raise invalid_setting(section, name, "true or false")


def invalid_setting(section: str, name: str, expected: str) -> StoreError:
    """Returns the error of a setting that is not what is expected."""
    place = f"[{section}] {name} = {setting(section, name)} in {_file_of(section, name)}"
    return StoreError(f"{place} is not {expected}. Correct it, or delete it for the default.")


def current_store(*, create: bool = True) -> Store:
    """Returns the store in STYLETRF_STORE, [store] root of `luigi.cfg`, or ./store.

    Raises:
        StoreError: There is no store, and it cannot or must not be created.
    """
    root = _place("STYLETRF_STORE", "store")
    if not create and not (root / "format").is_file():
        raise StoreError(f"there is no store at {root}")
    return open_store(root)


def data_root() -> Path:
    """Returns the folder of the user's data: STYLETRF_DATA, [data] root, or ./data."""
    return _place("STYLETRF_DATA", "data")


def out_root() -> Path:
    """Returns the folder that shows results: STYLETRF_OUT, [out] root, or ./out."""
    return _place("STYLETRF_OUT", "out")


def _place(variable: str, section: str) -> Path:
    """Returns the folder in an environment variable, or in `root` of a section."""
    return Path(os.environ.get(variable) or configured_path(section, "root")).absolute()


def configured_path(section: str, name: str) -> Path:
    """Returns a path setting; relative paths start at the folder of the file that has them."""
    with contextlib.suppress(RuntimeError):  # its `~` stands for no folder
        return _file_of(section, name).parent / Path(setting(section, name)).expanduser()
    raise invalid_setting(section, name, "a path")


def _file_of(section: str, name: str) -> Path:
    other = os.environ.get("LUIGI_CONFIG_PATH")
    return Path(other if other and _defines(other, section, name) else "luigi.cfg")


@functools.cache
def _defines(file: str, section: str, name: str) -> bool:
    config = configparser.ConfigParser(interpolation=None, strict=False)
    return bool(config.read(file)) and config.has_option(section, name)
