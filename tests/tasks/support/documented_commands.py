"""The commands that the documentation names.

They are the lines of blocks marked `sh`, and code in a sentence that begins with a program.
"""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[3]
PAGES = (
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "benchmarks/README.md")),
    *(page for name in ("docs", "deploy") for page in sorted((ROOT / name).rglob("*.md"))),
)
PROGRAMS = (
    ".ci/run", "blender", "luigi", "luigid", "make", "openssl", "pip", "pre-commit", "python", "rm",
    "ssh", "styletrf",
)  # fmt: skip
OF_THE_STORE = (
    "adopt", "du", "gc", "ls", "pin", "pull", "push", "show", "snapshot", "unpin", "verify", "why",
)  # fmt: skip
"""Commands of `python -m pipeline`, which pages name without it, too."""

_NOT_RUN = re.compile(r"^## Commands that no test runs\n.*?(?=^## )", re.MULTILINE | re.DOTALL)
_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_CODE = re.compile(r"`([^`\n]+)`")
_BEGINS_WITH_PROGRAM = re.compile(
    rf"(?:\w+=\S+ )*(?:\.venv/bin/)?(?:{'|'.join(map(re.escape, PROGRAMS))}) |\.ci/run$"
    r"|env \$\(|\(umask "
)
_OF_THE_STORE = re.compile(rf"(?:{'|'.join(OF_THE_STORE)}) ")
_OF_THE_SHELL = (".", "done", "env", "for", "seq", "umask")


@dataclass(frozen=True)
class Command:
    """One command, without the variables that are set for it."""

    page: str
    words: tuple[str, ...]

    def __str__(self) -> str:
        return shlex.join(self.words)

    @property
    def subject(self) -> str:
        """What is run, such as `make demo` or `python -m pipeline gc`; the rest are arguments."""
        return " ".join(self.words[: self._length])

    @property
    def arguments(self) -> list[str]:
        """The words after the subject."""
        return list(self.words[self._length :])

    @property
    def _length(self) -> int:
        if self.words[:2] == ("python", "-m"):
            return 4 if self.words[2] == "pipeline" else 3
        return 2 if self.words[0] in ("make", "pip", "pre-commit", "python", "styletrf") else 1


def documented_commands() -> list[Command]:
    """Returns the commands of all pages, except those that are listed as not run."""
    found: list[Command] = []
    for page in PAGES:
        text = _NOT_RUN.sub("", page.read_text(encoding="utf-8"))
        name = str(page.relative_to(ROOT))
        found += [Command(name, words) for words in _commands_in(text)]
    return found


def commands_not_run() -> dict[str, str]:
    """Returns the reason for each subject in the table of CONTRIBUTING.md."""
    ((section),) = _NOT_RUN.findall((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"))
    reasons: dict[str, str] = {}
    for row in (line for line in section.splitlines() if line.startswith("| `")):
        commands, reason = row.strip("| ").split(" | ")
        for code in _CODE.findall(commands):
            reasons |= {Command("", words).subject: reason for words in _parts(code)}
    return reasons


def _commands_in(text: str) -> Iterator[tuple[str, ...]]:
    for kind, block in _BLOCK.findall(text):
        for line in block.splitlines() if kind == "sh" else ():
            yield from _parts(line)
    for code in _CODE.findall(_BLOCK.sub("", text)):
        if _BEGINS_WITH_PROGRAM.match(code):
            yield from _parts(code)
        elif _OF_THE_STORE.match(code):
            yield from _parts(f"python -m pipeline {code}")


def _parts(line: str) -> Iterator[tuple[str, ...]]:
    """Yields the commands of a line, without assignments and words of the shell."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars=";&()")
    lexer.whitespace_split = True
    words: list[str] = []
    for word in [*lexer, ";"]:
        if not set(word) <= set(";&()"):
            is_before = not words and (word == "do" or re.match(r"\w+=", word))
            words += [] if is_before else [word if words else word.removeprefix(".venv/bin/")]
        elif words:
            if words[0] not in _OF_THE_SHELL:
                yield tuple(words)
            words = []
