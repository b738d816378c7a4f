"""What the user sets: `luigi.cfg`, and the environment variables that win over it."""

import configparser
import functools
import os
from pathlib import Path

import luigi
from luigi.cmdline_parser import CmdlineParser

from pipeline.errors import StoreError
from pipeline.remote import Remote, open_remote
from pipeline.signatures import SHORTEST_KEY
from pipeline.store import Store, open_store

PATIENCE = "STYLETRF_PATIENCE"
"""Where another machine is told how long to wait for the shared store."""
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
    ("night", "webhook"): "",  # where what became of a grid is posted, as JSON
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


def current_remote() -> Remote:
    """The shared store in STYLETRF_REMOTE, or in [store] remote of `luigi.cfg`; or none."""
    url = os.environ.get("STYLETRF_REMOTE", setting("store", "remote"))
    patience_seconds = os.environ.get(PATIENCE, setting("store", "patience_seconds"))
    options = setting("store", "remote_options")
    return open_remote(url, options, float(patience_seconds), signing_key() if url else b"")


def signing_key() -> bytes:
    """The key in the file that [store] signing_key of `luigi.cfg` names; empty where none is named.

    Raises:
        StoreError: The file cannot be read, or holds too little.
    """
    if not setting("store", "signing_key"):
        return b""
    path = _configured_path("store", "signing_key").expanduser()
    remedy = f"Make one for all machines: (umask 077; openssl rand -hex 32 > {path})"
    try:
        key = path.read_bytes().strip()
    except OSError as error:
        problem = f"[store] signing_key: {path} cannot be read ({error.strerror})"
        raise StoreError(f"{problem}. {remedy}.") from error
    if len(key) < SHORTEST_KEY:
        problem = f"[store] signing_key: {path} holds {len(key)} bytes, fewer than {SHORTEST_KEY}"
        raise StoreError(f"{problem}. {remedy}.")
    return key


def data_root() -> Path:
    """The user's data: STYLETRF_DATA, or [data] root of `luigi.cfg`, or ./data."""
    return _place("STYLETRF_DATA", "data")


def out_root() -> Path:
    """Where results are shown: STYLETRF_OUT, or [out] root of `luigi.cfg`, or ./out."""
    return _place("STYLETRF_OUT", "out")


def identity_file() -> Path:
    """The snapshot of the code: [store] identity of `luigi.cfg`, or ./tasks/identity.json."""
    return _configured_path("store", "identity")


def _place(variable: str, section: str) -> Path:
    """The folder in an environment variable, or in `root` of a section."""
    told = os.environ.get(variable)
    return (Path(told) if told else _configured_path(section, "root")).absolute()


def _configured_path(section: str, name: str) -> Path:
    """A path in the settings; a relative one starts at the folder of the file that names it."""
    other = os.environ.get("LUIGI_CONFIG_PATH")
    folder = Path(other).parent if other and _defines(other, section, name) else Path()
    return folder / setting(section, name)


@functools.cache
def _defines(file: str, section: str, name: str) -> bool:
    config = configparser.ConfigParser(interpolation=None, strict=False)
    return bool(config.read(file)) and config.has_option(section, name)


def require_configuration() -> None:
    """Stop a command line without settings, before Luigi goes looking for a scheduler.

    Luigi reads `luigi.cfg` in the working directory only, and falls back in silence.
    """
    is_command = CmdlineParser.get_instance() is not None  # type: ignore[no-untyped-call]
    config = luigi.configuration.get_config()  # type: ignore[no-untyped-call]
    if is_command and not config.has_section("store"):
        raise SystemExit(
            f"There is no luigi.cfg with a section [store] in {Path.cwd()}."
            " Run from the folder of the repository."
        )
