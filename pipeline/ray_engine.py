"""`python -m pipeline.ray_engine [ADDRESS] < ERRAND.json`: one errand, by a Ray cluster.

A process of its own, since Ray's threads do not survive a fork, which every worker of Luigi is.
"""

import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipeline.errand import NO_ENGINE, NODE, Errand, command
from pipeline.parent_process import die_with

_TIMES = 3
_SECONDS_TO_ANSWER = 10.0


def build_on_node(text: str) -> str:
    """What an errand prints; the node's process takes what it started with it when it dies."""
    errand = Errand.from_json(text)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "errand.json")
        file.write_text(text)
        done = subprocess.run(
            command(file),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
            cwd=errand.folder,
            env={**os.environ, **errand.environment, NODE: _this_node()},
        )
    return done.stdout


def _this_node() -> str:
    from ray import get_runtime_context

    return str(get_runtime_context().get_node_id())


def _require_answer(address: str) -> None:
    """Raises OSError where nobody listens, for which Ray itself would wait for minutes."""
    host, _, port = address.rpartition(":")
    if port.isdigit() and "/" not in host:
        socket.create_connection((host, int(port)), _SECONDS_TO_ANSWER).close()


def main() -> int:
    """Send the errand out, and print what became of it."""
    die_with(os.getppid())
    text = sys.stdin.read()
    errand = Errand.from_json(text)
    try:
        import ray

        _require_answer(sys.argv[1])
        ray.init(address=sys.argv[1] or "auto", log_to_driver=False, logging_level="ERROR")
    except (ImportError, OSError, RuntimeError, ValueError) as error:
        sys.stderr.write(f"{error}\n")
        return NO_ENGINE
    nodes = {node["NodeID"]: node["Resources"] for node in ray.nodes() if node["Alive"]}
    send = ray.remote(**needs(errand, nodes), max_retries=_TIMES)(build_on_node)
    try:
        sys.stdout.write(ray.get(send.remote(text)))
    except ray.exceptions.RayError as error:  # lost again and again
        first, *_, last = [*str(error).splitlines(), ""]
        sys.stderr.write(f"{first} {last}")
    return 0


def needs(errand: Errand, nodes: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    """What to ask Ray for: what the errand wants, as far as the node has it that has most of it.

    All of it where no node has a core: a cluster that grows on demand has to hear of it.

    Args:
        errand: To be sent.
        nodes: What each has, by its name.
    """
    wanted = {"GPU": errand.gpus, "memory": errand.memory_bytes, "CPU": errand.cores}
    could = {
        name: {n: min(most, int(node.get(n, 0))) for n, most in wanted.items()}
        for name, node in nodes.items()
    }
    working = [name for name in nodes if could[name]["CPU"]]
    fit = [could[name] for name in working if name not in errand.rather_not]
    most = fit or [could[name] for name in working] or [wanted]
    best = max(most, key=lambda node: list(node.values()))
    away = {"ray.io/node-id": f"!in({','.join(errand.rather_not)})"}
    return {
        "num_cpus": best["CPU"],
        "num_gpus": best["GPU"],
        "memory": best["memory"],
        "label_selector": away if errand.rather_not and fit else {},
    }


if __name__ == "__main__":
    sys.exit(main())
