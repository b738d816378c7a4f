"""What the key of a capture covers."""

from pathlib import Path

import pytest

import tasks


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a scene, which has one clip."""
    (folder := tmp_path / "scenes/walk").mkdir(parents=True)
    (folder / "a.mp4").write_bytes(b"clip")
    monkeypatch.setenv("STYLETRF_DATA", str(tmp_path))
    return folder


def digests() -> dict[str, str]:
    return dict(tasks.SceneCapture(scene="walk").external_digests())


def test_a_photograph_beside_a_clip_is_in_the_key_as_a_warning_names_it(scene: Path):
    before = digests()
    (scene / "plan.jpg").write_bytes(b"plan")
    assert before.items() < digests().items()


@pytest.mark.parametrize("mask", ["masks/a.mp4", "masks/a/1.png", "masks/other.png"])
@pytest.mark.parametrize("clip", ["walk/a.mp4", "walk/images/a.mp4", "walk.mp4"])
def test_the_content_and_the_name_of_the_mask_of_a_clip_are_in_the_key(
    scene: Path, clip: str, mask: str
):
    (scene / "images").mkdir()
    (scene / "a.mp4").rename(scene.parent / clip)
    before = digests()
    assert list(before) == [Path(clip).name]
    (scene / mask).parent.mkdir(parents=True)
    (scene / mask).write_bytes(b"mask")
    masked = digests()
    assert before.items() < masked.items()
    (scene / mask).write_bytes(b"another mask")
    assert digests() not in (before, masked)
    assert before.items() < digests().items()
    (scene / mask).rename((scene / mask).with_name("renamed.png"))
    assert masked.keys() - digests().keys() == {f"masks/walk/{mask}"}


def test_the_folder_of_a_masked_clip_is_in_its_key_as_it_decides_which_mask_it_has(scene: Path):
    (scene / "day").mkdir()
    (scene / "a.mp4").rename(scene / "day/a.mp4")
    (scene / "masks/day").mkdir(parents=True)
    (scene / "masks/day/a.mp4").write_bytes(b"mask")
    before = digests()
    (scene / "day").rename(scene / "night")
    assert digests() != before


def test_a_clip_alone_is_all_that_its_key_covers(scene: Path):
    assert list(digests()) == ["a.mp4"]


@pytest.mark.parametrize("clip", ["walk/b.mp4", "walk/images/b.mp4", "walk.mov"])
def test_the_name_of_a_clip_beside_photographs_is_in_the_key_as_a_warning_has_it(
    scene: Path, clip: str
):
    """The result of one command depended on clips that came later, and its key did not."""
    (scene / "a.mp4").unlink()
    (scene / "images").mkdir()
    for index in range(3):
        (scene / f"images/{index}.jpg").write_bytes(b"photograph")
    before = digests()
    assert list(before) == [f"images/{index}.jpg" for index in range(3)]
    (scene.parent / clip).write_bytes(b"clip")
    named = digests()
    assert before.items() < named.items()
    (scene.parent / clip).write_bytes(b"another clip")  # of which nothing is read
    assert digests() == named
