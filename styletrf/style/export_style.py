"""A trained style network for other programs: PyTorch's fast-neural-style example, or ONNX.

python -m styletrf.style.export_style FOLDER network.pth      or network.onnx

The example has Johnson's network only: one that began as the network of arbitrary style transfer
(`warm_start`) is exported as ONNX.
"""

import argparse
import sys
from pathlib import Path

import torch

from styletrf.errors import InputError
from styletrf.style.interchange import to_fast_neural_style
from styletrf.style.style_network import PaintingNetwork, StyleNetwork, load_style_network

_OF_THE_EXAMPLE = ".pth", ".pt", ".model"
_SUFFIXES = *_OF_THE_EXAMPLE, ".onnx"


def export_style_network(folder: Path, out: Path) -> None:
    """Writes the result of StyleNetwork in the format that the suffix of `out` names.

    Raises:
        InputError: The suffix is unknown, the folder of `out` does not exist, the network cannot
            be read, or the format cannot hold it.
    """
    suffix = out.suffix.lower()
    if suffix not in _SUFFIXES:
        problem = f"ends with none of {', '.join(_SUFFIXES)}"
        raise InputError(str(out), problem, "Give a name that does")
    if not out.parent.is_dir():
        raise InputError(str(out.parent), "is not a folder", "Create it first")
    network = load_style_network(folder)
    if suffix not in _OF_THE_EXAMPLE:
        to_onnx(network, out)
    elif isinstance(network, StyleNetwork):
        torch.save(to_fast_neural_style(network), out)
    else:
        problem = "has a network of arbitrary style transfer, which PyTorch's example cannot load"
        remedy = 'Give a name that ends with .onnx, or train with "warm_start": false'
        raise InputError(str(folder), problem, remedy)


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
    parser.add_argument("out", type=Path, help=f"a file that ends with {', '.join(_SUFFIXES)}")
    given = parser.parse_args(arguments)
    try:
        export_style_network(given.folder, given.out)
    except InputError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
