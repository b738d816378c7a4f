"""A Ray cluster for the tests, in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

import psutil

HERE = Path(__file__).parent
SETTINGS = {
    # A worker starts with its job. Each takes seconds, and a node would start one for each core.
    "RAY_enable_worker_prestart": "0",
    "RAY_prestart_worker_first_driver": "0",
    "RAY_USAGE_STATS_ENABLED": "0",
}


class RayCluster:
    """`ray_cluster.py`, and its address."""

    def __init__(self, **environment: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, HERE / "ray_cluster.py"],
            env=os.environ | SETTINGS | environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self.address, *raylets = self.process.stdout.readline().split()
        self.raylets = [int(pid) for pid in raylets]

    def do(self, words: str) -> None:
        self.process.stdin.write(f"{words}\n")
        self.process.stdin.flush()
        self.raylets = [int(pid) for pid in self.process.stdout.readline().split()]

    def node_of(self, pid: int) -> int:
        """The number of the node that a process belongs to, by the raylet above it."""
        mine = {p.pid for p in psutil.Process(pid).parents()}
        (place,) = (n for n, raylet in enumerate(self.raylets) if raylet in mine)
        return place

    def end(self) -> None:
        self.process.communicate(timeout=60)
