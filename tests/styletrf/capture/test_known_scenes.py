import pytest

from styletrf.capture.known_scenes import download_instructions


@pytest.mark.parametrize(
    ("name", "archive", "folder"),
    [
        ("horns", "nerf_llff_data.zip", "nerf_llff_data/horns/images"),
        ("lego", "nerf_synthetic.zip", "nerf_synthetic/lego/train"),
    ],
)
def test_public_scenes_are_known_with_archive_and_place(name, archive, folder):
    instructions = download_instructions(name)
    assert instructions is not None
    assert archive in instructions
    assert folder in instructions
    assert f"scenes/{name}/images" in instructions


def test_a_scene_that_is_not_public_has_no_download_instructions():
    assert download_instructions("my_garden") is None
