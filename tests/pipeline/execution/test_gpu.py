"""One build a GPU, over real commands and processes; their UUIDs are settings."""

import gc
import os
import signal
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import luigi
import pytest
from commands import are_gone, start
from expected_failures import refuses
from forked_modules import ForkedModule

from pipeline.execution import gpu
from pipeline.settings import current_store

Gpus = Callable[..., None]


@pytest.fixture
def gpus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Gpus]:
    """Sets the GPUs of this host, for this process and for those it starts."""
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    here = luigi.configuration.get_config()

    def set_gpus(names: str, leases: Path = tmp_path / "leases") -> None:
        file = tmp_path / "gpus.cfg"
        file.write_text(f"[gpu]\nuuids = {names}\n")
        monkeypatch.setenv("LUIGI_CONFIG_PATH", str(file))
        monkeypatch.setenv("STYLETRF_LEASES", str(leases))
        here.set("gpu", "uuids", names)

    yield set_gpus
    here.remove_section("gpu")


def on_gpu(name: str, *words: str) -> ForkedModule:
    return start("luigi", "--module", "toys", "OnGpu", "--name", name, *words)


def turns() -> dict[str, tuple[str, float, float]]:
    """GPU, begin and end of every build, by the task's name."""
    store, found = current_store(), {}
    for record in store.records():
        uuid, began, ended = (
            (store.object(record.output.digest) / "gpu.txt").read_text().rsplit(" ", 2)
        )
        found[record.provenance["label"].split()[1]] = (uuid, float(began), float(ended))
    return found


def finish(*commands) -> list[str]:
    screens = ["".join(command.communicate(timeout=60)) for command in commands]
    assert [command.returncode for command in commands] == [0] * len(commands), screens
    return screens


def await_begin(toys: Path, name: str, command: ForkedModule) -> None:
    while not (toys / f"began-{name}").exists():
        assert command.poll() is None
        time.sleep(0.02)


def test_two_commands_never_share_a_gpu(gpus, toys):
    gpus("GPU-a")
    first = on_gpu("one", "--awaited", "a command that waits")
    await_begin(toys, "one", first)
    second, waiting = on_gpu("two"), "waiting for a GPU, since all are leased"
    assert any(waiting in line for line in iter(second.stderr.readline, ""))
    (toys / "a command that waits").touch()
    assert not any(waiting in screen for screen in finish(first, second)), "one line says it"
    (_, first_end), (second_begin, _) = sorted((b, e) for _, b, e in turns().values())
    assert first_end <= second_begin
    assert {uuid for uuid, _, _ in turns().values()} == {"GPU-a"}


def test_two_gpus_are_both_used(gpus):
    gpus("GPU-a, GPU-b")
    first, second = (("one", "--awaited", "began-two"), ("two", "--awaited", "began-one"))
    screens = finish(on_gpu(*first), on_gpu(*second))
    assert {uuid for uuid, _, _ in turns().values()} == {"GPU-a", "GPU-b"}
    (_, first_end), (second_begin, _) = sorted((b, e) for _, b, e in turns().values())
    assert second_begin < first_end
    assert not any("waiting" in screen for screen in screens)


def test_workers_of_one_command_do_not_share_either(gpus):
    gpus("GPU-a")
    words = '["one", "two"]'
    finish(start("luigi", "--module", "toys", "OnGpus", "--names", words, "--workers", "2"))
    (_, first_end), (second_begin, _) = sorted((b, e) for _, b, e in turns().values())
    assert first_end <= second_begin


@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGINT])
def test_a_killed_command_frees_its_gpu(gpus, toys, sent):
    gpus("GPU-a")
    holder = on_gpu("one", "--awaited", "the signal")
    await_begin(toys, "one", holder)
    holder.send_signal(sent)
    holder.communicate()
    assert are_gone([holder.pid])
    finish(on_gpu("two"))
    assert set(turns()) == {"two"}


@pytest.mark.parametrize(("given", "seen"), [("1", "GPU-b"), ("GPU-b", "GPU-b"), ("", "")])
def test_the_users_choice_is_honored(gpus, monkeypatch, given, seen):
    gpus("GPU-a,GPU-b")
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", given)
    finish(on_gpu("one"))
    assert turns()["one"][0] == seen


def test_what_computes_on_the_cpu_leases_nothing_and_sees_nothing(gpus, tmp_path):
    gpus("GPU-a")
    finish(on_gpu("one", "--device", "cpu"))
    assert turns()["one"][0] == ""
    assert not list((tmp_path / "leases").glob("gpu-*"))


def test_a_host_without_gpus_leases_nothing(gpus, tmp_path, monkeypatch):
    gpus("")
    monkeypatch.setenv("PATH", str(tmp_path))
    finish(on_gpu("one"))
    assert turns()["one"][0] == "all"
    assert not list((tmp_path / "leases").glob("gpu-*"))


def test_nvidia_smi_lists_the_gpus(gpus, tmp_path, monkeypatch):
    gpus("")
    (tmp_path / "nvidia-smi").write_text(
        "#!/bin/sh\necho 'GPU 0: NVIDIA H200 (UUID: GPU-5f8a-11)'\n"
    )
    (tmp_path / "nvidia-smi").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    finish(on_gpu("one"))
    assert turns()["one"][0] == "GPU-5f8a-11"


@pytest.mark.parametrize("mode", [0o755, 0o644], ids=["fails", "cannot be run"])
def test_gpus_that_cannot_be_listed_are_leased_to_nobody(gpus, tmp_path, monkeypatch, mode):
    gpus("")
    (tmp_path / "nvidia-smi").write_text("#!/bin/sh\nexit 9\n")
    (tmp_path / "nvidia-smi").chmod(mode)
    monkeypatch.setenv("PATH", str(tmp_path))
    with refuses("nvidia-smi", "[gpu] uuids"), gpu.leased(print):
        pass


def test_a_divided_gpu_is_leased_in_its_parts():
    listing = """\
GPU 0: NVIDIA A100-SXM4-40GB (UUID: GPU-aa)
  MIG 3g.20gb     Device  0: (UUID: MIG-a0)
  MIG 3g.20gb     Device  1: (UUID: MIG-a1)
GPU 1: NVIDIA A100-SXM4-40GB (UUID: GPU-bb)
"""
    assert gpu.UUID_LINE.findall(listing) == ["MIG-a0", "MIG-a1", "GPU-bb"]
    assert gpu.UUID_LINE.findall("No devices found.\n") == []


@pytest.mark.parametrize(
    ("wanted", "left"),
    [
        (None, ["GPU-a1", "GPU-b1", "GPU-b2"]),
        ("", []),
        ("-1", []),
        ("2,0", ["GPU-b2", "GPU-a1"]),
        (" GPU-b2 ,", ["GPU-b2"]),
        ("GPU-c", []),
    ],
)
def test_the_variable_of_cuda_chooses_and_orders_the_gpus(wanted, left):
    assert gpu.visible(["GPU-a1", "GPU-b1", "GPU-b2"], wanted) == left


def test_the_leases_are_open_to_other_users(gpus, tmp_path):
    """Whatever the umask: a folder like /tmp, files that everybody can open."""
    gpus("GPU-a")
    before = os.umask(0o077)
    try:
        with gpu.leased(lambda: None) as (environment, holds):
            assert environment == {"CUDA_VISIBLE_DEVICES": "GPU-a"}
            assert len(holds) == 1
            assert os.umask(0o077) == 0o077
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "leases").stat().st_mode) == 0o1777
    assert stat.S_IMODE((tmp_path / "leases" / "gpu-GPU-a").stat().st_mode) == 0o644


@pytest.mark.skipif(os.getuid() != 0, reason="only root can be another user")
def test_another_users_lease_is_honored_and_then_used(gpus):
    def take_as(user: int) -> int:
        child = os.fork()
        if child == 0:
            gc.freeze()  # see `forked` in support/killing.py
            answer = 1
            try:
                os.setuid(user)
                with gpu.leased(lambda: os._exit(2)):
                    answer = 0
            finally:
                os._exit(answer)
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])

    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o777)
        gpus("GPU-a", Path(folder) / "leases")
        assert take_as(1234) == 0
        assert (Path(folder) / "leases" / "gpu-GPU-a").stat().st_uid == 1234
        assert take_as(4321) == 0
        with gpu.leased(lambda: None):
            assert take_as(4321) == 2


@pytest.mark.parametrize("obstacle", ["symlink_to", "a file for a folder"])
def test_an_unusable_lease_folder_is_reported(gpus, tmp_path, obstacle):
    gpus("GPU-a")
    if obstacle == "symlink_to":
        (tmp_path / "leases").mkdir()
        (tmp_path / "leases" / "gpu-GPU-a").symlink_to("/etc/passwd")
    else:
        (tmp_path / "leases").touch()
    with refuses(str(tmp_path / "leases"), "gpu-GPU-a", "[host] leases"), gpu.leased(print):
        pass
