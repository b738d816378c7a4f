"""A SLURM cluster of one node on this machine: controller, node and credentials, in one folder."""

import contextlib
import os
import shutil
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
SlurmdPort={node}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
JobRequeue=1
ReturnToService=2
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmdTimeout=10
KillWait=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory={memory_mib} State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def is_installed() -> bool:
    """Whether all that it takes is there, and may be started: by root alone."""
    return os.geteuid() == 0 and all(shutil.which(p, path=_path()) for p in PROGRAMS)


class SlurmCluster:
    """Runs until it is ended; `SLURM_CONF` of its clients is `settings`."""

    def __init__(self, folder: Path) -> None:
        self.settings = folder / "slurm.conf"
        for name in ("state", "spool"):
            (folder / name).mkdir()
        key = folder / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        folder.chmod(0o755)
        self.settings.write_text(
            _SETTINGS.format(
                host=socket.gethostname().partition(".")[0],
                controller=_free_port(),
                node=_free_port(),
                user="root",
                folder=folder,
                cores=os.cpu_count(),
                memory_mib=psutil.virtual_memory().total * 9 // 10 >> 20,
            )
        )
        names = {"key-file": "key", "socket": "socket", "pid-file": "pid", "log-file": "log"}
        munge = [f"--{word}={folder}/munge.{name}" for word, name in names.items()]
        self._processes = [
            self._start("munged", "--foreground", "--force", f"--seed-file={folder}/seed", *munge),
            self._start("slurmctld", "-D", "-i", "-f", str(self.settings)),
            self._start("slurmd", "-D", "-f", str(self.settings)),
        ]
        self._await_node()

    def end(self) -> None:
        """End it, and what it runs."""
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

    def _await_node(self) -> None:
        deadline = time.monotonic() + _SECONDS_TO_START
        ask = ["sinfo", "-h", "-o", "%T"]
        while time.monotonic() < deadline:
            said = subprocess.run(
                ask, env=self._environment(), capture_output=True, text=True, check=False
            )
            if said.stdout.strip() == "idle":
                return
            time.sleep(0.2)
        self.end()
        raise TimeoutError(f"no node is idle: {said.stdout}{said.stderr}")


def _path() -> str:
    return os.pathsep.join([os.environ["PATH"], "/usr/sbin"])


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])
