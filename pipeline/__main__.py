"""`python -m pipeline COMMAND`: see `pipeline/maintenance/command_line.py`."""

import sys

from pipeline.maintenance.command_line import main

if __name__ == "__main__":
    sys.exit(main())
