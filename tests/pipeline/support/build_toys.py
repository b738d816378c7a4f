"""Tasks that end in every way a build can end, and that make Luigi stumble."""

import contextlib
import json
import logging
import os
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import luigi
from store_toys import NO_WORD, Slow, ToyError, Word, mark
from store_toys import Sentence as Sentence

from pipeline.task import RunContext, StoredTask

MEBIBYTE = 2**20
UNREACHABLE = "example.org: cannot be reached. Check the network"
"""What the toys say where their network is away."""
EAT = "import sys, time; food = bytearray({mebibytes} << 20); time.sleep({seconds})"


class LostError(ToyError):
    """The toys' network is away."""


class Act(StoredTask):
    """Does what its `act` says, in its build."""

    act = luigi.Parameter()
    user_errors = (ToyError,)
    transient_errors = (ConnectionError, LostError)

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        mark(self)
        (out / "half.txt").write_text("half")
        sys.stdout.write("printed by python\n")
        os.write(1, b"printed by a library\n")
        getattr(self, self.act)(run)
        (out / "whole.txt").write_text(os.environ.get("CUDA_VISIBLE_DEVICES", "all"))

    def succeed(self, run: RunContext) -> None:
        pass

    def sleep_a_little(self, run: RunContext) -> None:
        time.sleep(1)

    def import_a_library(self, run: RunContext) -> None:
        import imported_toy

        is_own = os.getpid() == imported_toy.IMPORTED_BY
        Path(run.resume.with_name("out"), "importer.txt").write_text("it" if is_own else "server")

    def warn(self, run: RunContext) -> None:
        run.progress(1, 2)
        logging.getLogger("toys").warning("this is\nodd")
        logging.getLogger("toys").info("this is not")

    def refuse(self, run: RunContext) -> None:
        raise ToyError(NO_WORD)

    def refuse_until_mended(self, run: RunContext) -> None:
        if not Path(os.environ["STYLETRF_TOYS"], "mended").exists():
            raise ToyError(NO_WORD)

    def lament(self, run: RunContext) -> None:
        raise ToyError("\N{LOUDLY CRYING FACE}" * 100_000)

    def be_killed_while_it_tells(self, run: RunContext) -> None:
        (report,) = (n for n in range(3, 20) if _is_second_output(n))
        os.write(report, b'{"kind": "built", "mess')
        os.kill(os.getpid(), signal.SIGKILL)

    def crash(self, run: RunContext) -> None:
        raise RuntimeError("a defect")

    def save_tensors(self, run: RunContext) -> None:
        import numpy as np
        from safetensors.numpy import save_file

        save_file({"large": np.ones(8 * MEBIBYTE)}, run.resume / "tensors.safetensors")

    def copy(self, run: RunContext) -> None:
        copy = ["dd", "if=/dev/zero", f"of={run.resume / 'zeros'}", "bs=1M", "count=8"]
        subprocess.run(copy, check=True, stderr=subprocess.DEVNULL)

    def lose(self, run: RunContext) -> None:
        raise ConnectionResetError("the other side went away")

    def lose_once(self, run: RunContext) -> None:
        if not (run.resume / "tried").exists():
            (run.resume / "tried").touch()
            raise LostError(UNREACHABLE)

    def leave(self, run: RunContext) -> None:
        sys.exit(0)

    def leave_with_7(self, run: RunContext) -> None:
        os._exit(7)

    def be_terminated(self, run: RunContext) -> None:
        os.kill(os.getpid(), signal.SIGTERM)

    def be_killed(self, run: RunContext) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    def let_a_child_eat(self, run: RunContext) -> None:
        code = EAT.format(mebibytes=200, seconds=0.5)
        subprocess.run([sys.executable, "-c", code], check=True)

    def let_an_outsider_eat(self, run: RunContext) -> None:
        code = EAT.format(mebibytes=200, seconds=0.5)
        subprocess.run([sys.executable, "-c", code], check=True, start_new_session=True)

    def eat(self, run: RunContext) -> None:
        food = [bytearray(MEBIBYTE) for _ in range(2000)]
        time.sleep(len(food))

    def sleep(self, run: RunContext) -> None:
        child = subprocess.Popen([sys.executable, "-c", EAT.format(mebibytes=1, seconds=60)])
        pids = Path(os.environ["STYLETRF_TOYS"]) / "pids.tmp"
        pids.write_text(f"{os.getpid()} {child.pid}")
        pids.rename(pids.with_suffix(".txt"))
        time.sleep(60)


def _is_second_output(descriptor: int) -> bool:
    """Whether it is the pipe on which the builder reports, beside its standard error."""
    with contextlib.suppress(OSError):
        return stat.S_ISFIFO(os.fstat(descriptor).st_mode)
    return False


class Acts(luigi.WrapperTask):
    """Several acts."""

    acts = luigi.ListParameter()

    def requires(self) -> list[StoredTask]:
        return [Act(act) for act in self.acts]


class Large(StoredTask):
    """A mebibyte, written for a while."""

    name = luigi.Parameter()

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        mark(self)
        time.sleep(0.3)
        (out / "large").write_text(self.name * MEBIBYTE)


class Larges(luigi.WrapperTask):
    """Several mebibytes."""

    names = luigi.ListParameter()

    def requires(self) -> list[StoredTask]:
        return [Large(name) for name in self.names]


class Steps(luigi.Task):
    """Several mebibytes, and acts, which the command looks at when it ends."""

    names = luigi.ListParameter()
    acts = luigi.ListParameter(default=[])

    def requires(self) -> list[StoredTask]:
        return [*(Large(name) for name in self.names), *(Act(act) for act in self.acts)]

    def complete(self) -> bool:
        return all(step.complete() for step in self.requires())


class SlowBatch(luigi.WrapperTask):
    """More to do than what another worker may be at."""

    def requires(self) -> StoredTask:
        return Slow()


class Settled(StoredTask):
    """Keyed by settings."""

    settings = luigi.DictParameter()

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        mark(self)
        (out / "settled.txt").touch()


class Said(StoredTask):
    """The same word in every edition."""

    edition = luigi.IntParameter()

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        mark(self)
        (out / "said.txt").write_text("hello")


class Echo(StoredTask):
    """Repeats what is said, whichever edition it is of."""

    edition = luigi.IntParameter(significant=False)

    def requires(self) -> dict[str, StoredTask]:
        return {"said": Said(self.edition)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        mark(self)
        (out / "echo.txt").write_text((inputs["said"] / "said.txt").read_text())


class OnGpu(StoredTask):
    """Notes when it had which GPU, and keeps it until a file is in the folder of the toys."""

    name = luigi.Parameter()
    awaited = luigi.Parameter(default="", significant=False)
    device = luigi.Parameter(default="auto", significant=False)

    @property
    def needs_gpu(self) -> bool:
        return self.device != "cpu"

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        uuid, began = os.environ.get("CUDA_VISIBLE_DEVICES", "all"), time.monotonic()
        toys = Path(os.environ["STYLETRF_TOYS"])
        (toys / f"began-{self.name}").touch()
        deadline = began + 30  # so that no process stays where a test fails
        while not (toys / self.awaited).exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        time.sleep(0.3)
        (out / "gpu.txt").write_text(f"{uuid} {began} {time.monotonic()}")


class OnGpus(luigi.WrapperTask):
    """Several that each want a GPU."""

    names = luigi.ListParameter()

    def requires(self) -> list[StoredTask]:
        return [OnGpu(name) for name in self.names]


class Given(luigi.ExternalTask):
    """A file that somebody else has to bring."""

    path = luigi.Parameter()

    def output(self) -> luigi.LocalTarget:
        return luigi.LocalTarget(self.path)


class WithGiven(luigi.WrapperTask):
    """What somebody else has to bring, and a word."""

    path = luigi.Parameter()

    def requires(self) -> list[luigi.Task]:
        return [Given(self.path), Word("a")]


class Greedy(Word):
    """Wants more of something than there is."""

    resources = {"unobtainium": 2}  # noqa: RUF012  Luigi's way


class Rootless(Word):
    """Cannot say what it needs."""

    def requires(self) -> dict[str, StoredTask]:
        raise RuntimeError("a defect in requires")


class Forgetful(Word):
    """Never is complete, whatever it built."""

    def complete(self) -> bool:
        return False


class OnCores(StoredTask):
    """Notes when it ran on which cores, with how many threads to start."""

    name = luigi.Parameter()
    seconds = luigi.FloatParameter(default=0.5, significant=False)

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        began = time.monotonic()
        time.sleep(self.seconds)
        measured = {
            "cores": sorted(os.sched_getaffinity(0)),
            "threads": os.environ.get("OMP_NUM_THREADS"),
            "began": began,
            "ended": time.monotonic(),
        }
        (out / "cores.json").write_text(json.dumps(measured))


class ManyOnCores(luigi.WrapperTask):
    """Several that each want cores."""

    names = luigi.ListParameter()

    def requires(self) -> list[StoredTask]:
        return [OnCores(name) for name in self.names]


class HelloAndSlow(luigi.WrapperTask):
    """A word, and what keeps the command at work."""

    def requires(self) -> list[StoredTask]:
        return [Word("hello"), Slow()]
