"""Small tasks that the tests build, some of them in other processes."""

import errno
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import luigi

from pipeline.task import RunContext, StoredTask

NO_WORD = "words/bad: is no word. Choose another one."
"""What the toys say of their user's mistake."""


class ToyError(Exception):
    """A mistake of the user of the toys."""


class Word(StoredTask):
    """A file with a word; every build leaves a mark in the folder STYLETRF_TOYS."""

    word = luigi.Parameter()
    loudness = luigi.FloatParameter(default=1.0)
    threads = luigi.IntParameter(default=1, significant=False)
    user_errors = (ToyError,)

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        mark(self)
        if self.word == "bad":
            raise ToyError(NO_WORD)
        if self.word == "crash":
            raise RuntimeError("a defect")
        (out / "word.txt").write_text(self.word.lower())


class Sentence(StoredTask):
    """Two words."""

    words = luigi.ListParameter(default=("hello", "world"))

    def requires(self) -> dict[str, StoredTask]:
        return {f"word{i}": Word(word) for i, word in enumerate(self.words)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        mark(self)
        text = " ".join((path / "word.txt").read_text() for _, path in sorted(inputs.items()))
        (out / "sentence.txt").write_text(text)


class Surroundings(StoredTask):
    """The environment of a build."""

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        (out / "environment.json").write_text(json.dumps(dict(os.environ)))


class Account(StoredTask):
    """What a build knows of everything above it."""

    def requires(self) -> dict[str, StoredTask]:
        return {"sentence": Sentence(), "word": Word("hello")}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        lineage = [[r.action.family, r.action.parameters, r.output.digest] for r in run.lineage]
        (out / "lineage.json").write_text(json.dumps(lineage))


class Slow(StoredTask):
    """Starts a grandchild, checkpoints, and sleeps; done at once when it finds its checkpoint."""

    mode = luigi.Parameter(default="sleep")

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        mark(self)
        checkpoint = run.resume / "step.txt"
        if checkpoint.exists():
            (out / "result.txt").write_text("resumed")
            return
        (out / "half.txt").write_text("half")
        sys.stdout.write("printed by python\n")
        os.write(1, b"printed by a library\n")
        grandchild = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
        checkpoint.write_text("1")
        pids = Path(os.environ["STYLETRF_TOYS"]) / "pids.tmp"
        pids.write_text(f"{os.getpid()} {grandchild.pid}")
        pids.rename(pids.with_suffix(".txt"))
        if self.mode == "suicide":
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(60)


class Lasting(StoredTask):
    """Takes long enough for another process to come along, and for a bar."""

    steps = luigi.IntParameter(default=20, significant=False)

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        mark(self)
        for step in range(self.steps):
            run.progress(step, self.steps, loss=1 / (step + 1))
            time.sleep(0.1)
        (out / "done.txt").write_text("done")


class Fills(StoredTask):
    """Meets a full disk."""

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        (out / "half").write_text("half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(out / "half"))


class Batch(luigi.WrapperTask):
    """Several words."""

    words = luigi.ListParameter()

    def requires(self) -> list[StoredTask]:
        return [Word(word) for word in self.words]


def mark(task: StoredTask) -> None:
    """Note that the task was built."""
    folder = Path(os.environ["STYLETRF_TOYS"])
    (folder / f"{task.label}.{os.getpid()}.{time.monotonic_ns()}").touch()


def built() -> list[str]:
    """The labels of all tasks built so far."""
    folder = Path(os.environ["STYLETRF_TOYS"])
    return sorted(p.name.split(".")[0] for p in folder.iterdir() if p.name.count(".") == 2)
