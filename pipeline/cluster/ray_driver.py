"""`python -m pipeline.cluster.ray_driver [ADDRESS] < JOB.json`: runs one job on a Ray cluster.

It prints the output of the job. It is a separate process, since Ray's threads do not survive a
fork, and every worker of Luigi is forked.
"""

import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipeline.cluster.remote_job import NODE, RemoteJob, runner_command
from pipeline.execution.parent_process import die_with

_MAX_RETRIES = 3
_SECONDS_TO_CONNECT = 10.0


def run_on_node(text: str) -> str:
    """Returns the output of the job on this node. The job ends if this process is killed."""
    from ray import get_runtime_context

    node = str(get_runtime_context().get_node_id())
    job = RemoteJob.from_json(text)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "job.json")
        file.write_text(text)
        process = subprocess.run(
            runner_command(file),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
            cwd=job.folder,
            env={**os.environ, **job.environment, NODE: node},
        )
    return process.stdout


def _require_listener(address: str) -> None:
    """Raises OSError if nothing listens at the address; Ray itself would wait for minutes."""
    host, _, port = address.rpartition(":")
    if port.isdigit() and "/" not in host:
        socket.create_connection((host, int(port)), _SECONDS_TO_CONNECT).close()


def main() -> int:
    """Submits the job and prints its output; returns EX_UNAVAILABLE if Ray cannot be used."""
    die_with(os.getppid())
    text = sys.stdin.read()
    job = RemoteJob.from_json(text)
    try:
        import ray

        _require_listener(sys.argv[1])
        ray.init(address=sys.argv[1] or "auto", log_to_driver=False, logging_level="ERROR")
    except (ImportError, OSError, RuntimeError, ValueError) as error:
        sys.stderr.write(f"{error}\n")
        return os.EX_UNAVAILABLE
    nodes = {node["NodeID"]: node["Resources"] for node in ray.nodes() if node["Alive"]}
    remote = ray.remote(**resource_request(job, nodes), max_retries=_MAX_RETRIES)(run_on_node)
    try:
        sys.stdout.write(ray.get(remote.remote(text)))
    except ray.exceptions.RayError as error:  # the node was lost at every retry
        first, *_, last = [*str(error).splitlines(), ""]
        sys.stderr.write(f"{first} {last}")
    return 0


def resource_request(job: RemoteJob, nodes: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    """Returns the options of `ray.remote`: the needs of the job, as far as one node has them.

    If no node has a core, all of it is requested, so that a cluster which grows on demand grows.

    Args:
        job: The job to submit.
        nodes: The resources of each node, by its name.
    """
    needed = {"GPU": job.gpus, "memory": job.memory_bytes, "CPU": job.cores}
    offers = {
        name: {n: min(most, int(node.get(n, 0))) for n, most in needed.items()}
        for name, node in nodes.items()
    }
    working = [name for name in nodes if offers[name]["CPU"]]
    allowed = [offers[name] for name in working if name not in job.excluded_nodes]
    candidates = allowed or [offers[name] for name in working] or [needed]
    best = max(candidates, key=lambda offer: list(offer.values()))
    others = {"ray.io/node-id": f"!in({','.join(job.excluded_nodes)})"}
    return {
        "num_cpus": best["CPU"],
        "num_gpus": best["GPU"],
        "memory": best["memory"],
        "label_selector": others if job.excluded_nodes and allowed else {},
    }


if __name__ == "__main__":
    sys.exit(main())
