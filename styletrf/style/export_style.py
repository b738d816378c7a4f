"""A trained style network for other programs: PyTorch's fast-neural-style example, or ONNX.

python -m styletrf.style.export_style FOLDER network.pth      or network.onnx
"""

import argparse
import sys
from pathlib import Path

import torch

from styletrf.errors import InputError
from styletrf.style.interchange import to_fast_neural_style
from styletrf.style.style_network import PaintingNetwork, StyleNetwork, load_style_network


def to_onnx(network: PaintingNetwork, path: Path) -> None:
    """Writes the network as ONNX: `image` in, `painted` out, 1 3 height width in [0, 1].

    Raises:
        InputError: The packages that write ONNX are not installed.
    """
    image, sides = torch.rand(1, 3, 64, 96), {2: "height", 3: "width"}
    try:
        torch.onnx.export(
            network.eval(), (image,), str(path), input_names=["image"], output_names=["painted"],
            dynamic_shapes={"images": dict.fromkeys(sides, torch.export.Dim.DYNAMIC)},
            dynamo=True, external_data=False, verbose=False,
        )  # fmt: skip
    except ImportError as error:
        problem = f"needs a package that is not there ({error.name})"
        raise InputError("ONNX export", problem, "Run pip install 'styletrf[onnx]'") from error


def main(arguments: list[str] | None = None) -> int:
    """Converts the result of StyleNetwork; the suffix decides the format."""
    parser = argparse.ArgumentParser(
        prog="python -m styletrf.style.export_style", description=__doc__
    )
    parser.add_argument("folder", type=Path, help="what StyleNetwork left")
    parser.add_argument("out", type=Path, help="a file that ends with .pth or .onnx")
    given = parser.parse_args(arguments)
    try:
        network = load_style_network(given.folder)
        if given.out.suffix == ".onnx":
            to_onnx(network, given.out)
        elif isinstance(network, StyleNetwork):
            torch.save(to_fast_neural_style(network), given.out)
        else:
            problem = "is a network of arbitrary style transfer, which the example has not"
            raise InputError(str(given.folder), problem, "Write a file that ends with .onnx")
    except InputError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
