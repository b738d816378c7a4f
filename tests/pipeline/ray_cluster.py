"""A Ray cluster of three nodes on this machine, in a process of its own.

It prints its address and its nodes, then does what each line of its standard input says: `kill N`
ends a node as a power cut would, `add` brings another; and prints its nodes: the process of each.
"""

import sys

from ray.cluster_utils import Cluster


def main() -> None:
    head = {"num_cpus": 0, "include_dashboard": False}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    nodes = [cluster.add_node(num_cpus=2, num_gpus=1) for _ in range(2)]

    def tell(*words: str) -> None:
        raylets = (node.all_processes["raylet"][0].process.pid for node in nodes)
        print(*words, *raylets, flush=True)  # noqa: T201  for who started it

    tell(cluster.address)
    for line in sys.stdin:
        word, *which = line.split()
        if word == "kill":
            cluster.remove_node(nodes.pop(int(which[0])), allow_graceful=False)
        else:
            nodes.append(cluster.add_node(num_cpus=2, num_gpus=1))
        tell()
    cluster.shutdown()


if __name__ == "__main__":
    main()
