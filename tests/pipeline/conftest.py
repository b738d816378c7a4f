"""The folder in which the toys note that they were built, and the stores they share."""

import functools
import json
from collections.abc import Callable, Iterator
from pathlib import Path

import luigi
import pytest
from commands import close_server, command_server
from fsspec import get_filesystem_class
from memory import folder_in_memory
from shared_stores import Place, Server, proxy_of

from pipeline.code import closure
from pipeline.code.source import data_files
from pipeline.execution.fork_server import forked_by
from pipeline.settings import current_store
from pipeline.shared_store.remote import open_remote
from pipeline.store import Store


@pytest.fixture(autouse=True, scope="session")
def _forked_commands() -> Iterator[None]:
    yield
    close_server()


@pytest.fixture
def forked_builds() -> Iterator[None]:
    """Builds of this process are forked from the server of its commands."""
    with forked_by(command_server()):
        yield


@pytest.fixture(autouse=True)
def toys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the toys' marks."""
    folder = tmp_path / "toys"
    folder.mkdir()
    monkeypatch.setenv("STYLETRF_TOYS", str(folder))
    return folder


@pytest.fixture
def tmp_path(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Path]:
    with folder_in_memory(tmp_path, request.config) as folder:
        yield folder


@pytest.fixture(scope="session")
def listed_once() -> Callable[[str], dict[str, Path]]:
    """The files of a package, which are listed once: the project does not change meanwhile."""
    return functools.cache(data_files)


@pytest.fixture(autouse=True)
def _listed_once(listed_once: Callable[[str], dict[str, Path]], monkeypatch) -> None:
    """Toys are no part of the project; for each of their keys, its files would be listed again."""

    def listed(package: str) -> dict[str, Path]:
        return listed_once(package) if package in closure.PROJECT else data_files(package)

    monkeypatch.setattr(closure, "data_files", listed)


@pytest.fixture(scope="session")
def server() -> Iterator[Server]:
    """An S3 server."""
    server = Server()
    yield server
    server.kill()


@pytest.fixture(autouse=True)
def _forgetful() -> None:
    """What this process knows of shared stores: which failed, and where S3 was."""
    open_remote.cache_clear()
    get_filesystem_class("s3").clear_instance_cache()


@pytest.fixture(params=["directory", "s3"])
def shared(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Place:
    """An empty shared store, which is the current one: a directory, and a bucket."""
    if request.param == "s3":
        server: Server = request.getfixturevalue("server")
        for name, value in server.environment().items():
            monkeypatch.setenv(name, value)
        place = server.bucket()
    else:
        place = Place(str(tmp_path / "shared"))
        Path(place.url).mkdir()
    monkeypatch.setenv("STYLETRF_REMOTE", place.url)
    return place


@pytest.fixture
def store() -> Store:
    """The test's empty store."""
    return current_store()


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """Go on as another machine, with an empty store."""

    def go(name: str = "elsewhere") -> Store:
        monkeypatch.setenv("STYLETRF_STORE", str(tmp_path / name))
        luigi.task_register.Register.clear_instance_cache()
        open_remote.cache_clear()
        return current_store()

    return go


@pytest.fixture
def proxied(server: Server, monkeypatch):
    """A bucket behind a proxy that can fail."""
    with proxy_of(server) as proxy:
        for name, value in server.environment(proxy.port).items():
            monkeypatch.setenv(name, value)
        place = server.bucket()
        monkeypatch.setenv("STYLETRF_REMOTE", place.url)
        yield place, proxy


@pytest.fixture
def _impatient(monkeypatch):
    """A second for each request, instead of five."""
    client = {"read_timeout": 1, "retries": {"mode": "standard", "total_max_attempts": 3}}
    config = luigi.configuration.get_config()
    config.set("store", "remote_options", json.dumps({"config_kwargs": client}))
    yield
    config.remove_option("store", "remote_options")


@pytest.fixture
def _unshared(monkeypatch):
    """Builds that upload nothing."""
    config = luigi.configuration.get_config()
    config.set("store", "push", "false")
    yield
    config.remove_option("store", "push")
