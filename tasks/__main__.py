"""`python -m tasks TASK ...`: see `tasks/command_line.py`."""

import sys

from tasks.command_line import run


def main() -> None:
    """Runs a command and exits with its status."""
    sys.exit(run(sys.argv[1:]))


if __name__ == "__main__":
    main()
