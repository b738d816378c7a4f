"""One of several processes that train a style network: `python -m tasks.stages.training_rank`.

The argument is a file with a `TrainingRequest` as JSON. The first process prints its progress, one
JSON message a line.
"""

import json
import logging
import os
import sys
from pathlib import Path

from pipeline.execution.parent_process import die_with
from pipeline.execution.progress_pipe import ProgressPipe
from styletrf.errors import InputError
from tasks.stages.distributed_training import TrainingRequest, train_local


class WarningForwarder(logging.Handler):
    """Forwards warnings to the process that shows the progress."""

    def __init__(self, pipe: ProgressPipe) -> None:
        super().__init__(logging.WARNING)
        self._pipe = pipe

    def emit(self, record: logging.LogRecord) -> None:
        """Forwards a warning."""
        self._pipe.say(f"StyleNetwork: warning: {record.getMessage()}")


def main() -> None:
    """Trains as one rank of several."""
    die_with(os.getppid())  # torchrun starts its processes in new sessions
    request, pipe = TrainingRequest(**json.loads(Path(sys.argv[1]).read_text())), ProgressPipe(1)
    logging.getLogger().addHandler(WarningForwarder(pipe))
    try:
        train_local(request, pipe)
    except InputError as error:
        pipe.send(refused=[error.subject, error.problem, error.remedy])
        raise


if __name__ == "__main__":
    main()
