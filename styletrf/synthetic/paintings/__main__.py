"""`python -m styletrf.synthetic.paintings OUT_DIR`: writes the style images."""

import argparse
import sys
from pathlib import Path

from styletrf.synthetic.paintings import write_paintings


def main(arguments: list[str] | None = None) -> int:
    """Returns the exit code; the paths of the paintings go to standard output."""
    parser = argparse.ArgumentParser(
        prog="python -m styletrf.synthetic.paintings", description=__doc__
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    sys.stdout.writelines(f"{path}\n" for path in write_paintings(given.folder, given.seed))
    return 0


if __name__ == "__main__":
    sys.exit(main())
