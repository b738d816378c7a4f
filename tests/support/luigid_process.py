"""A real `luigid` for the tests, in a process of its own."""

import configparser
import os
import socket
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]


class Luigid:
    """A `luigid` on a free port, and the settings for it and for its workers."""

    def __init__(
        self, folder: Path, retries: int = 2, attempts: int = 2, idle: str = "5 seconds"
    ) -> None:
        self.config = folder / "cluster.cfg"
        with socket.create_server(("127.0.0.1", 0)) as server:
            self.port = server.getsockname()[1]
        settings = configparser.ConfigParser()
        settings.read(ROOT / "luigi.cluster.cfg")
        settings["core"]["scheduler_url"] = f"http://127.0.0.1:{self.port}/"
        settings["core"].update({"rpc-retry-attempts": str(attempts), "rpc-retry-wait": "1"})
        settings["scheduler"].update({"worker_disconnect_delay": "2", "retry_delay": "1"})
        settings["scheduler"]["retry_count"] = str(retries)
        settings["scheduler"]["prune_on_get_work"] = "true"
        settings["worker"].update({"max_keep_alive_idle_duration": idle, "wait_interval": "0.2"})
        with self.config.open("w") as file:
            settings.write(file)
        self.start()

    def start(self) -> None:
        """Start it, with nothing scheduled."""
        command = [Path(sys.executable).with_name("luigid"), "--address", "127.0.0.1"]
        self.process = subprocess.Popen(
            [*command, "--port", str(self.port)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=self.config.parent,
            env=os.environ | {"LUIGI_CONFIG_PATH": str(self.config)},
        )
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline:
            try:
                socket.create_connection(("127.0.0.1", self.port), timeout=1).close()
            except OSError:
                time.sleep(0.05)
            else:
                return
        raise TimeoutError("luigid does not answer")

    def kill(self) -> None:
        """As by a power failure."""
        self.process.kill()
        self.process.wait()
