"""A SLURM cluster on this machine: controller, nodes and credentials, in one folder.

What a node runs is known by its host's name, which no other has (a UTS namespace of its own).
"""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path

import psutil

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "sinfo")
_SECONDS_TO_START = 60
_SETTINGS = """
ClusterName=toys
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket,cred_expire=5
CredType=cred/munge
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
JobRequeue=1
ReturnToService=2
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/%n.log
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmdTimeout=15
TreeWidth=65533
SlurmdParameters=config_overrides
SchedulerParameters=sched_interval=1
KillWait=2
{nodes}
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def is_installed() -> bool:
    """Whether all that it takes is there, and may be started: by root alone."""
    return os.geteuid() == 0 and all(shutil.which(p, path=_path()) for p in PROGRAMS)


class SlurmCluster:
    """Two nodes, and others that join, until it is ended; `settings` is its clients' `SLURM_CONF`.

    `do` and `node_of` are as those of a `RayCluster`; a node with a disk of its own comes first.
    """

    def __init__(self, folder: Path) -> None:
        self.settings = folder / "slurm.conf"
        (folder / "state").mkdir()
        key = folder / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        folder.chmod(0o755)
        self._unused = [f"toy{n}" for n in range(12)]
        self.settings.write_text(
            _SETTINGS.format(
                host=socket.gethostname().partition(".")[0],
                controller=_free_port(),
                nodes="\n".join(_node(n, name) for n, name in enumerate(self._unused)),
                user="root",
                folder=folder,
            )
        )
        names = {"key-file": "key", "socket": "socket", "pid-file": "pid", "log-file": "log"}
        munge = [f"--{word}={folder}/munge.{name}" for word, name in names.items()]
        self._processes = [
            self._start("munged", "--foreground", "--force", f"--seed-file={folder}/seed", *munge),
            self._start("slurmctld", "-D", "-i", "-f", str(self.settings)),
        ]
        self.nodes: list[tuple[str, subprocess.Popen[bytes]]] = []
        for _ in range(2):
            self.do("add")

    def do(self, words: str) -> None:
        """`kill N`, `add`, or `apart FOLDER MEBIBYTES CORES`."""
        word, *which = words.split()
        if word == "kill":
            _, process = self.nodes.pop(int(which[0]))
            _cut_power(process.pid)
            process.wait()
            return
        name = self._unused.pop(0 if word == "add" else -1)
        disk = f"mount -t tmpfs -o size={which[1]}m tmpfs {which[0]};" if which else ""
        begin = f"{disk} hostname {name}; exec slurmd -D -N {name} -f {self.settings}"
        self.nodes.append((name, self._start("unshare", "--uts", "--mount", "sh", "-ec", begin)))
        self._await_node(name)

    def node_of(self, pid: int) -> int:
        """The number of the node that a process belongs to."""
        (place,) = (n for n, (_, node) in enumerate(self.nodes) if _host(node.pid) == _host(pid))
        return place

    def end(self) -> None:
        """End it, and what it runs."""
        while self.nodes:
            self.do("kill 0")
        for process in reversed(self._processes):
            with contextlib.suppress(psutil.Error):
                for child in psutil.Process(process.pid).children(recursive=True):
                    child.kill()
            process.kill()
            process.wait()

    def _start(self, *command: str) -> "subprocess.Popen[bytes]":
        out = self.settings.with_name(f"{command[0]}.out").open("wb")
        with out:
            return subprocess.Popen(
                command, env=self._environment(), stdout=out, stderr=out, start_new_session=True
            )

    def _environment(self) -> dict[str, str]:
        return {**os.environ, "SLURM_CONF": str(self.settings), "PATH": _path()}

    def _await_node(self, name: str) -> None:
        deadline = time.monotonic() + _SECONDS_TO_START
        ask = ["sinfo", "-h", "-n", name, "-o", "%T"]
        while time.monotonic() < deadline:
            said = subprocess.run(
                ask, env=self._environment(), capture_output=True, text=True, check=False
            )
            if said.stdout.strip() == "idle":
                return
            time.sleep(0.2)
        self.end()
        raise TimeoutError(f"{name} is not idle: {said.stdout}{said.stderr}")


def _node(number: int, name: str) -> str:
    """The configuration of a node; SLURM chooses the last ones first."""
    memory_mib = psutil.virtual_memory().total * 9 // 10 >> 20
    return (
        f"NodeName={name} NodeHostname={name} NodeAddr=127.0.0.1 Port={_free_port()} CPUs=2"
        f" RealMemory={memory_mib} Weight={100 - number} State=UNKNOWN"
    )


def _host(pid: int) -> str:
    """The namespace by which a process belongs to a node."""
    with contextlib.suppress(OSError):
        return os.readlink(f"/proc/{pid}/ns/uts")  # noqa: PTH115  it is no path
    return ""


def _cut_power(pid: int) -> None:
    """End all processes of a node at once."""
    host = _host(pid)
    for other in psutil.pids():
        if host not in ("", _host(os.getpid())) and _host(other) == host:
            with contextlib.suppress(OSError):
                os.kill(other, signal.SIGKILL)


def _path() -> str:
    return os.pathsep.join([os.environ["PATH"], "/usr/sbin"])


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])
