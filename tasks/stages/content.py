"""The content images that a style network is trained on."""

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import luigi

from pipeline.digest import file_digest
from pipeline.parameters import NameParameter
from pipeline.settings import data_root
from pipeline.task import RunContext
from styletrf.errors import InputError
from styletrf.files.linked_folders import walk_files
from tasks.machine.digest_cache import cached_digests
from tasks.stages.scene import SceneCapture
from tasks.stages.stage import ConfigurableStage, Stage

CONTENT = (
    "the images that a style network learns to paint: a folder, a zip or an annotations file, by"
    " path or by name in data/content; auto for the one there, or else embedded, the scene's"
    " photographs and procedural images"
)
"""What `--content` means."""


class ContentImages(ConfigurableStage):
    """Photographs for the style network to paint while it learns, as Parquet shards.

    `content` is a folder, a zip or an annotations file, by path or by its name in `data/content`;
    `auto` takes the one in `data/content`, and where there is none, `embedded`: photographs of the
    scene itself and as many procedural images, or 64. Images fetched by an annotations file stay in
    `data/content/.fetched`.
    """

    content = luigi.Parameter(default="auto", description=CONTENT)
    scene = NameParameter(description="a folder in data/scenes; its photographs if embedded")
    tools = ("opencv-contrib-python-headless",)

    def requires(self) -> Mapping[str, Stage]:
        """Returns the scene's photographs, if they are the content."""
        with suppress(InputError):  # which the run reports
            if self._source() is None:
                return {"capture": self.upstream(SceneCapture)}
        return {}

    def external_digests(self) -> Mapping[str, str]:
        """Returns the digest of the source's files.

        Raises:
            InputError: The source is not there.
        """
        from styletrf.capture.photographs import require_readable_name

        source = self._source()
        if source is None:
            return {}
        if not source.exists():
            remedy = "Give auto, embedded, or a path or a name in data/content"
            raise InputError(f"--content {self.content}", "there is no such file or folder", remedy)
        found = sorted(walk_files(source)) if source.is_dir() else [source]
        files = {path.relative_to(source.parent): path for path in found if path.is_file()}
        for name in files:
            require_readable_name(str(name))
        return cached_digests(
            {name.as_posix(): path for name, path in files.items() if ".fetched" not in name.parts}
        )

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Reduces the images and writes the shards."""
        from styletrf.steps.sources.content_images import gather_content

        source, fetched = self._source(), self.fetched
        gather_content(
            inputs, out, self.values(), self.step_run(run), source=source, fetched=fetched
        )

    def fetched(self, annotations: Path, otherwise: Path) -> Path:
        """Returns the folder of the images fetched so far: the user's, if it can be written."""
        name = f"{annotations.stem}-{file_digest(annotations)[:8]}"
        kept = data_root() / "content/.fetched" / name
        with suppress(OSError):
            kept.mkdir(parents=True, exist_ok=True)
            if os.access(kept, os.W_OK):
                return kept
        otherwise.mkdir(parents=True, exist_ok=True)
        return otherwise

    def _source(self) -> Path | None:
        """Returns the user's content, or None for the embedded set."""
        from styletrf.capture.user_folders import find_content

        return find_content(data_root(), self.content)
