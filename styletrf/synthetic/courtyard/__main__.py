"""`python -m styletrf.synthetic.courtyard DIR`: writes the embedded scene as photographs."""

import argparse
import sys
from pathlib import Path

from tqdm import tqdm

from styletrf.errors import InputError
from styletrf.progress import Progress
from styletrf.synthetic.courtyard.capture import KINDS, CourtyardConfig
from styletrf.synthetic.courtyard.folder import write_courtyard


def main(arguments: list[str] | None = None) -> int:
    """Returns the exit code: 0 where the photographs are in place, 2 for a bad request."""
    given = _parser().parse_args(arguments)
    config = CourtyardConfig(
        kind=given.kind,
        n_views=given.views,
        width=given.width,
        height=given.height,
        glossy=not given.matte,
        seed=given.seed,
    )
    try:
        with tqdm(total=config.n_views, desc="courtyard", unit="view", disable=None) as bar:
            write_courtyard(given.folder, config, _shown_on(bar))
    except InputError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    sys.stdout.write(f"{given.folder / 'images'}\n")
    return 0


def _parser() -> argparse.ArgumentParser:
    default = CourtyardConfig()
    parser = argparse.ArgumentParser(
        prog="python -m styletrf.synthetic.courtyard", description=__doc__
    )
    parser.add_argument("folder", type=Path, help="gets images/ and truth/")
    parser.add_argument("--kind", choices=KINDS, default=default.kind)
    parser.add_argument("--views", type=int, default=default.n_views)
    parser.add_argument("--width", type=int, default=default.width, help="pixels")
    parser.add_argument("--height", type=int, default=default.height, help="pixels")
    parser.add_argument("--matte", action="store_true", help="leave the glossy vase out")
    parser.add_argument("--seed", type=int, default=default.seed)
    return parser


def _shown_on(bar: "tqdm[object]") -> Progress:
    def show(done: int, total: int, **_quality: float) -> None:
        bar.total = total
        bar.update(done - bar.n)

    return show


if __name__ == "__main__":
    sys.exit(main())
