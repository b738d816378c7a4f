"""Grids under faults: machines with their own disks and a bucket, killed builds, lost servers.

python tests/support/faulty_grids.py luigid    two machines: a build killed, luigid killed and
                                               back, a bucket that errs for a minute, a full disk
python tests/support/faulty_grids.py ray       three nodes: one killed while it trains, the same
                                               bucket, a node whose disk is full from the start

Mounts file systems: needs root. Ends with what was lost, or built twice.
"""

import contextlib
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import psutil
from small_grids import GridRun, prepare

sys.path.append(str(Path(__file__).parents[1] / "pipeline/support"))
from luigid_process import Luigid
from ray_process import RayCluster
from shared_stores import Proxy, Server, proxy_of
from small_disk import small_disk

from pipeline.maintenance.attempts import attempts
from pipeline.maintenance.verify import problems
from pipeline.store import Store

Fault = Callable[[], None]
_MEBIBYTE = 1 << 20


def under_luigid(grid: GridRun, proxy: Proxy) -> None:
    """Two commands, of which nobody takes care; one goes on until its disk is full."""
    luigid = Luigid(grid.root, retries=20, attempts=60, idle="12 hours")
    full = grid.root / "full"
    stores = {"full": full / "store", "roomy": grid.root / "roomy"}

    def begin(name: str) -> psutil.Popen:
        place = {
            "STYLETRF_STORE": str(stores[name]),
            "STYLETRF_OUT": str(grid.root / "out" / name),
        }
        return grid.begin(**place, LUIGI_CONFIG_PATH=str(luigid.config))

    def restart_luigid() -> None:
        luigid.kill()
        time.sleep(2)
        luigid.start()

    with small_disk(full, mebibytes=512):
        commands = {name: begin(name) for name in stores}
        faults = iter([
            (15, lambda: _kill_a_build(commands["roomy"])),
            (30, restart_luigid),
            (45, lambda: _fail_for(proxy, 60)),
            (120, lambda: _fill(full)),
        ])  # fmt: skip
        for _ in _happening(faults):
            if commands["roomy"].poll() is not None:
                break
        screen, _ = commands["roomy"].communicate()
        shown = [p for p in (grid.root / "out/roomy").glob("*/*/report.html") if p.exists()]
        if commands["roomy"].returncode or len(shown) != 4 or not (full / "filler").exists():
            commands["full"].kill()
            raise SystemExit(screen)
        screen, _ = commands["full"].communicate()
        reasons = [line for line in screen.splitlines() if "luigid;" in line or "no space" in line]
        print("the machine whose disk was filled:", reasons or screen.splitlines()[-3:])  # noqa: T201
        luigid.kill()
        _tell([Store.open(path) for path in stores.values()])


def on_ray(grid: GridRun, proxy: Proxy) -> None:
    """One command; its store is a disk of their own for all nodes, which see no other's."""
    cluster, store = RayCluster(), grid.root / "store"
    store.mkdir()
    for mebibytes in (512, 1, 512):
        cluster.do(f"apart {store} {mebibytes} 1")
    for _ in range(2):
        cluster.do("kill 0")  # those that would see the command's own store
    (grid.root / "ray.cfg").write_text(
        f"[ray]\naddress = {cluster.address}\n[host]\ncores = 1\n[scheduler]\nretry_count = 3\n"
    )
    words = ("--executor", "ray", "--workers", "3")  # so that each node gets something
    command = grid.begin(*words, LUIGI_CONFIG_PATH=str(grid.root / "ray.cfg"))

    def lose_a_node() -> None:
        training = next(p for p in psutil.process_iter() if _is_training(p))
        cluster.do(f"kill {cluster.node_of(training.pid)}")
        cluster.do(f"apart {store} 512 1")

    faults = iter(
        [(1, lambda: _await_training()), (2, lose_a_node), (60, lambda: _fail_for(proxy, 60))]
    )
    for _ in _happening(faults):
        if command.poll() is not None:
            break
    screen, _ = command.communicate()
    sent = [line for line in screen.splitlines() if "moved to another node" in line]
    print(f"status {command.returncode}; moved to another node for lack of disk space: {len(sent)}")  # noqa: T201
    if command.returncode:
        raise SystemExit(screen)
    there = [Path(f"/proc/{raylet}/root{store}") for raylet in cluster.raylets]
    _tell([Store.open(path) for path in (*there, store)])
    cluster.end()


def _happening(faults: Iterator[tuple[float, Fault]]) -> Iterator[None]:
    """Twice a second; each fault at its time."""
    begun, upcoming = time.monotonic(), next(faults, None)
    while True:
        if upcoming and time.monotonic() - begun > upcoming[0]:
            upcoming[1]()
            upcoming = next(faults, None)
        time.sleep(0.5)
        yield


def _kill_a_build(command: psutil.Popen) -> None:
    while not (below := psutil.Process(command.pid).children(recursive=True)):
        time.sleep(0.1)
    below[-1].kill()


def _is_training(process: psutil.Process) -> bool:
    """Whether it builds a field; what it is to build lies on the disk that it alone sees."""
    with contextlib.suppress(OSError, psutil.Error):
        if "pipeline.execution.supervisor" in " ".join(words := process.cmdline()):
            job = Path(f"/proc/{process.pid}/root{words[-1]}").read_text()
            return '"RadianceField"' in job
    return False


def _await_training() -> None:
    while not any(_is_training(p) for p in psutil.process_iter()):
        time.sleep(0.1)


def _fail_for(proxy: Proxy, seconds: float) -> None:
    end = time.monotonic() + seconds
    proxy.fault = lambda _method, _path: 500 if time.monotonic() < end else None


def _fill(disk: Path) -> None:
    with (disk / "filler").open("wb") as file:
        try:
            while True:
                file.write(bytes(_MEBIBYTE))
                file.flush()
        except OSError:
            return


def _tell(stores: list[Store]) -> None:
    """Ends where something is broken; prints what was built twice."""
    broken = [problem for store in stores for problem in problems(store, deep=True)]
    finished = Counter(a.log.name[:16] for s in stores for a in attempts(s) if a.is_published)
    twice = [
        (record.provenance["label"], finished[record.action.key[:16]])
        for record in stores[-1].records()
        if finished[record.action.key[:16]] > 1
    ]
    print(f"built {finished.total()}, of these twice: {twice or 'none'}")  # noqa: T201
    if broken:
        raise SystemExit(f"{broken=}")


def _require_nothing_left(grid: GridRun) -> None:
    """Ends unless a machine that has nothing finds everything in the bucket, and builds nothing."""
    screen, _ = (c := grid.begin(STYLETRF_STORE=str(grid.root / "new"))).communicate()
    if c.returncode or ": started" in screen:
        raise SystemExit(screen)
    print("a machine that has nothing finds all of it")  # noqa: T201


def main() -> None:
    """Runs the grid that the argument names."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        grid, server = prepare(Path(folder), 2, 2), Server()
        stack.callback(server.kill)
        proxy = stack.enter_context(proxy_of(server))
        os.environ |= server.environment(proxy.port) | {"STYLETRF_REMOTE": server.bucket().url}
        {"luigid": under_luigid, "ray": on_ray}[sys.argv[1]](grid, proxy)
        _require_nothing_left(grid)


if __name__ == "__main__":
    main()
