"""`styletrf view SCENE`, and `python -m tasks TASK ...`.

See `tasks/view/view_command.py` and `tasks/command_line.py`.
"""

import importlib
import sys


def main() -> None:
    """Runs a command and exits with its status."""
    words = sys.argv[1:]
    is_view = words[:1] == ["view"]
    module = "tasks.view.view_command" if is_view else "tasks.command_line"
    sys.exit(importlib.import_module(module).run(words[1:] if is_view else words))


if __name__ == "__main__":
    main()
