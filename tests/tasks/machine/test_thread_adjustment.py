"""The display of a build, by which the threads of a stage follow the free cores."""

from pathlib import Path

from store_toys import Word

from pipeline.execution import builder
from pipeline.job import Display, Job, RunContext
from styletrf.free_cores import FreeCoreThreads
from tasks.machine.thread_adjustment import ThreadAdjustment
from tasks.stages.stage import Stage


class Recorder(Display):
    """Records what a build reports."""

    def __init__(self) -> None:
        self.reports: list[tuple[object, ...]] = []

    def __call__(self, done: int, total: int, **quality: float) -> None:
        self.reports.append((done, total, quality))

    def say(self, line: str) -> None:
        self.reports.append((line,))

    def close(self) -> None:
        self.reports.append(())


def test_reports_of_every_stage_adjust_its_threads_and_are_shown(monkeypatch):
    adjusted = []
    monkeypatch.setattr(FreeCoreThreads, "adjust", lambda threads: adjusted.append(threads))
    shown = Recorder()
    display = Stage.display_of_build(None, shown)
    display(1, 2, psnr=3.0)
    display.say("a line")
    display.close()
    assert len(adjusted) == 1
    assert shown.reports == [(1, 2, {"psnr": 3.0}), ("a line",), ()]


def test_a_build_reports_to_the_display_of_its_task(tmp_path, monkeypatch):
    seen = []

    def build(_task: Word, _inputs: dict[str, Path], _out: Path, run: RunContext) -> None:
        seen.append(run.progress)

    monkeypatch.setattr(Word, "display_of_build", lambda _task, shown: ThreadAdjustment(shown))
    monkeypatch.setattr(Word, "build", build)
    folders = {name: str(tmp_path / name) for name in ("out", "resume", "log")}
    job = Job(
        module=Word.__module__, task="Word", parameters={"word": "hi", "loudness": "1.0"},
        label="Word", inputs={}, **folders,
    )  # fmt: skip
    assert builder.run_job(job, Recorder())[0] == "built"
    assert [type(each) for each in seen] == [ThreadAdjustment]
