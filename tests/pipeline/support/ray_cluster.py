"""A Ray cluster of three nodes on this machine, in a process of its own.

It prints its address and its nodes, then does what each line of its standard input says: `kill N`
ends a node as a power cut would, `add` brings another, `apart FOLDER MEBIBYTES CPUS` one whose
folder is a disk of its own; and prints its nodes: the process of each.
"""

import ctypes
import subprocess
import sys

from ray.cluster_utils import Cluster

_CLONE_NEWNS = 0x20000


def give_own_disk(folder: str, mebibytes: str) -> None:
    """Mount a disk at the folder that the nodes begun from now on see, and nobody else does."""
    ctypes.CDLL(None).unshare(_CLONE_NEWNS)
    disk = ["-t", "tmpfs", "-o", f"size={mebibytes}m", "tmpfs", folder]
    for words in (["--make-rprivate", "/"], disk):
        subprocess.run(["mount", *words], check=True)


def main() -> None:
    idle = {"include_dashboard": False, "include_log_monitor": False, "no_monitor": True}
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, **idle})
    nodes = [cluster.add_node(num_cpus=2, num_gpus=1) for _ in range(2)]

    def tell(*words: str) -> None:
        raylets = (node.all_processes["raylet"][0].process.pid for node in nodes)
        print(*words, *raylets, flush=True)  # noqa: T201  for who started it

    tell(cluster.address)
    for line in sys.stdin:
        word, *which = line.split()
        if word == "kill":
            cluster.remove_node(nodes.pop(int(which[0])), allow_graceful=False)
        elif word == "apart":
            give_own_disk(*which[:2])
            nodes.append(cluster.add_node(num_cpus=int(which[2])))
        else:
            nodes.append(cluster.add_node(num_cpus=2, num_gpus=1))
        tell()
    cluster.shutdown()


if __name__ == "__main__":
    main()
