"""Sizes of the source: `python benchmarks/structure.py`, the table of `docs/architecture.md`.

All Python modules count, `__init__.py` included, but not in the sizes of folders.
"""

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("styletrf", "pipeline", "tasks")
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
IMPORTS = (ast.Import, ast.ImportFrom)


def rows(package: str) -> Iterator[tuple[str, str]]:
    """Yields what is counted in a package, and the count."""
    texts = {path: path.read_text(encoding="utf-8") for path in (ROOT / package).rglob("*.py")}
    lines = {path: len(text.splitlines()) for path, text in texts.items()}
    folders = Counter(path.parent for path in texts if path.name != "__init__.py")
    longest = max(lines, key=lambda path: lines[path])
    trees = {path: ast.parse(text) for path, text in texts.items()}
    functions = [(length, name, path) for path in trees for length, name in _functions(trees[path])]
    length, name, path = max(functions)
    yield "files, lines", f"{len(texts)}, {sum(lines.values()):,}"
    yield "largest folder, files", str(max(folders.values()))
    yield "longest file, lines", f"`{longest.relative_to(ROOT)}`, {lines[longest]}"
    yield "longest function, lines", f"`{name}` in `{path.relative_to(ROOT)}`, {length}"
    yield "imports inside functions", str(sum(map(_inner_imports, trees.values())))


def _functions(tree: ast.Module) -> Iterator[tuple[int, str]]:
    for node in ast.walk(tree):
        if isinstance(node, FUNCTIONS):
            yield (node.end_lineno or node.lineno) - node.lineno + 1, node.name


def _inner_imports(tree: ast.Module) -> int:
    """Returns the number of imports inside functions."""
    functions = [node for node in ast.walk(tree) if isinstance(node, FUNCTIONS)]
    found = {node for each in functions for node in ast.walk(each) if isinstance(node, IMPORTS)}
    return len(found)


if __name__ == "__main__":
    for each in PACKAGES:
        print(f"| `{each}/` | |\n|---|---|")  # noqa: T201
        for what, count in rows(each):
            print(f"| {what} | {count} |")  # noqa: T201
