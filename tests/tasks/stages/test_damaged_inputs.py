"""One number that is not finite in what a stage is given stops it, and the stage names it."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pyarrow.parquet as pq
import pytest
from safetensors.torch import load_file, save_file

from styletrf.errors import InputError, NotFiniteError

FIELD = ("field", "appearance.safetensors", "factors.planes.0")
DENSITY = ("field", "density.safetensors", "factors.lines.1")
POSES = ("poses", "cameras.parquet", "camera 2")
CASES = [
    ("SceneModel", {}, POSES),
    ("SceneModel", {}, ("poses", "points.parquet", "column y")),
    ("RadianceField", {}, POSES),
    ("RadianceField", {}, ("poses", "points.parquet", "column y")),
    ("TrajectoryFrames", {}, FIELD),
    ("TrajectoryFrames", {}, DENSITY),
    ("PriorRenders", {}, DENSITY),
    ("PriorRenders", {}, ("trajectory", "frames/0002.exr", "Z")),
    ("QualityMetrics", {}, FIELD),
    ("StyleNetwork", {}, ("perceptual", "vgg16.safetensors", "conv2_1.weight")),
    ("StylizedPriors", {}, ("network", "style_network.safetensors", "expansion.12.bias")),
    ("StylizedPriors", {}, ("priors", "frames/0001.exr", "G")),
    ("StylizedPriors", {"stylizer": "gatys"},
     ("perceptual", "vgg16.safetensors", "conv2_1.weight")),
    ("StylizedPriors", {"rounds": 2}, ("before", "appearance.safetensors", "background")),
    ("StylizedField", {}, FIELD),
    ("StylizedField", {}, ("priors", "frames/0001.exr", "R")),
    ("StylizedField", {"match": "gram"}, ("perceptual", "vgg16.safetensors", "conv2_1.weight")),
    ("StylizedField", {}, ("transfer", "predictor.safetensors", "stem.conv.weight")),
    ("StylizedField", {"strategy": "s2"}, DENSITY),
    ("StylizedFrames", {}, ("stylized", "appearance.safetensors", "shading.basis.weight")),
    ("StylizedFrames", {}, DENSITY),
    ("StylizedFrames", {"strength": 0.5}, FIELD),
    ("StylizedFrames", {"method": "per-frame"}, ("trajectory", "frames/0002.exr", "B")),
    ("ConsistencyMetrics", {}, ("unstylized", "frames/0002.exr", "R")),
    ("ConsistencyMetrics", {}, ("perceptual", "vgg16.safetensors", "conv2_1.weight")),
    ("StylizationMetrics", {}, ("unstylized", "frames/0003.exr", "G")),
    ("Viewer", {}, FIELD),
    ("Viewer", {}, DENSITY),
    ("Viewer", {}, ("stylized p", "appearance.safetensors", "shading.basis.weight")),
    ("Viewer", {}, POSES),
    ("Export", {"format": "ply"}, FIELD),
    ("Export", {"format": "ply"}, DENSITY),
    ("Export", {"format": "ply"}, ("stylized p", "appearance.safetensors", "shading.basis.weight")),
    ("Export", {"format": "cameras", "styles": ()}, POSES),
]  # fmt: skip


def spoil(path: Path, name: str, value: float) -> None:
    """Makes one number of the named tensor, channel, column or camera not finite."""
    if path.suffix == ".safetensors":
        tensors = load_file(path)
        tensors[name].view(-1)[0] = value
        save_file(tensors, path)
    elif path.suffix == ".exr":
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {n: np.array(channel.pixels) for n, channel in file.channels().items()}
        channels[name][3, 4] = value
        OpenEXR.File({}, channels).write(str(path))
    else:
        table = pq.read_table(path)
        rows = table.to_pylist()
        if name.startswith("camera"):
            rows[int(name.split()[1])]["world_from_camera"][7] = value
        else:
            rows[5][name.split()[1]] = value
        pq.write_table(type(table).from_pylist(rows, schema=table.schema), path)


@pytest.mark.parametrize(
    ("family", "words", "damage"), CASES,
    ids=[f"{family}-{'-'.join(damage[:2])}-{damage[2]}" for family, _, damage in CASES],
)  # fmt: skip
@pytest.mark.parametrize("value", [np.nan, -np.inf], ids=["NaN", "infinity"])
def test_a_damaged_input_stops_its_stage_which_names_it(
    stage_of: Callable[..., Any], build: Callable[..., Path], tmp_path: Path,
    family: str, words: dict[str, Any], damage: tuple[str, str, str], value: float,
):  # fmt: skip
    needed, file, name = damage
    stage, inputs = stage_of(family, **words)
    damaged = tmp_path / "damaged"
    shutil.copytree(inputs[needed], damaged)
    spoil(damaged / file, name, value)
    with pytest.raises((InputError, NotFiniteError)) as refused:
        build(stage, **{**inputs, needed: damaged})
    assert name in str(refused.value)
    assert file in str(refused.value)
