"""`python -m tasks TASK ...`: see `tasks/command_line.py`."""

import sys

from tasks.command_line import run

if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))
