"""`python -m pipeline.ray_engine ERRAND.json [ADDRESS]`: one errand, by a Ray cluster.

A process of its own, since Ray's threads do not survive a fork, which every worker of Luigi is.
"""

import os
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

from pipeline.errand import NO_ENGINE, Errand, command
from pipeline.execute import die_with

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
            env={**os.environ, **errand.environment},
        )
    return done.stdout


def _require_answer(address: str) -> None:
    """Raises OSError where nobody listens, for which Ray itself would wait for minutes."""
    host, _, port = address.rpartition(":")
    if port.isdigit() and "/" not in host:
        socket.create_connection((host, int(port)), _SECONDS_TO_ANSWER).close()


def main() -> int:
    """Send the errand out, and print what became of it."""
    die_with(os.getppid())
    text = Path(sys.argv[1]).read_text()
    errand = Errand.from_json(text)
    try:
        import ray

        _require_answer(sys.argv[2])
        ray.init(address=sys.argv[2] or "auto", log_to_driver=False, logging_level="ERROR")
    except (ImportError, OSError, RuntimeError, ValueError) as error:
        sys.stderr.write(f"{error}\n")
        return NO_ENGINE
    nodes = [node["Resources"] for node in ray.nodes() if node["Alive"]]

    def most(name: str, wanted: int) -> int:
        return min(wanted, max(int(node.get(name, 0)) for node in nodes))

    needs = {"num_cpus": most("CPU", errand.cores), "num_gpus": most("GPU", errand.gpus)}
    memory = most("memory", errand.memory_bytes)
    send = ray.remote(**needs, memory=memory, max_retries=_TIMES)(build_on_node)
    try:
        sys.stdout.write(ray.get(send.remote(text)))
    except ray.exceptions.RayError as error:  # lost again and again
        sys.stderr.write(str(error).splitlines()[0])
    return 0


if __name__ == "__main__":
    sys.exit(main())
