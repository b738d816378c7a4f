"""`styletrf view SCENE`, `python -m tasks TASK ...`, and the help of both.

See `tasks/view/view_command.py` and `tasks/command_line.py`.
"""

import importlib
import sys
from difflib import get_close_matches

import tasks

HELP = """\
styletrf turns photographs of a place and one painting into a fly-through in the painting's style.

usage: styletrf TASK --parameter VALUE ...      the same as luigi --module tasks TASK ...
       styletrf TASK --help                     lists the parameters of a task
       styletrf view SCENE                      serves the viewer of a scene

tasks:
  SceneReport          checks the photographs of a scene before a long build
  StylizedTrajectory   makes the fly-through of a scene in one style, with its report
  Grid                 makes every style on every scene, with a gallery
  Viewer               makes one HTML file to walk around in, with several styles
  Export               writes Gaussian splats, points, a mesh, or cameras for other programs
  TradeOff             measures what the settings of a scene cost and gain

example: styletrf StylizedTrajectory --scene horns --style mosaic --quality draft

Run commands in the root of the repository, or in another folder that contains your data/.
README.md and docs/getting_started.md lead to a first result, and docs/index.md lists all pages.
`python -m pipeline --help` lists the commands of the store.
"""


def main() -> None:
    """Runs a command and exits with its status; without a task it prints the help."""
    arguments = sys.argv[1:]
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        sys.stdout.write(HELP)
        sys.exit(0 if arguments else 2)
    if alike := _alike(arguments):
        sys.exit(f"There is no {arguments[0]}. Did you mean {' or '.join(alike)}?")
    is_view = arguments[:1] == ["view"]
    module = "tasks.view.view_command" if is_view else "tasks.command_line"
    sys.exit(importlib.import_module(module).run(arguments[1:] if is_view else arguments))


def _alike(arguments: list[str]) -> list[str]:
    """Returns the commands with a name like the first word, if that is none of them.

    Without any, Luigi reads the command, which may load tasks of the user by `--module`.
    """
    commands = ["view", "help", *tasks.__all__]
    if arguments[0] in commands or any(word.startswith("--module") for word in arguments):
        return []
    return get_close_matches(arguments[0], commands)


if __name__ == "__main__":
    main()
