"""A field reads back as it was written."""

from dataclasses import replace

import torch
from mini_scene import MINI_FIT, fit

from styletrf.field.radiance_field import load_field, save_field


def test_a_field_reads_back_as_it_was_written_but_for_the_rounding_of_factors(scene, tmp_path):
    field = fit(scene, replace(MINI_FIT, iterations=25))
    save_field(tmp_path, field)
    again = load_field(tmp_path)
    assert again.step_length == field.step_length
    for name, tensor in field.state_dict().items():
        rounded = tensor.half().float() if ".factors." in name else tensor
        assert torch.equal(rounded, again.state_dict()[name]), name
    (tmp_path / "again").mkdir()
    save_field(tmp_path / "again", again)
    for file in ("density.safetensors", "appearance.safetensors"):
        assert (tmp_path / file).read_bytes() == (tmp_path / "again" / file).read_bytes()


def test_factors_too_large_for_16_bits_are_not_rounded(scene, tmp_path):
    field = fit(scene, replace(MINI_FIT, iterations=2))
    with torch.no_grad():
        field.density.factors.planes[1][0, 0, 0] = 1e5
    save_field(tmp_path, field)
    assert torch.equal(
        load_field(tmp_path).density.factors.planes[1], field.density.factors.planes[1]
    )


def test_power_of_the_weights_is_kept_with_the_field(scene, tmp_path):
    field = fit(scene, replace(MINI_FIT, iterations=2))
    field.appearance.weight_power = 1.5
    save_field(tmp_path, field)
    assert load_field(tmp_path).appearance.weight_power == 1.5
