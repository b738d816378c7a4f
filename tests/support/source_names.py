"""Names in source files of Python, by their syntax: comments and sentences do not count."""

import ast
from collections.abc import Iterable, Iterator
from pathlib import Path


def syntax_of(path: Path) -> ast.Module:
    """Returns the syntax of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


def names_of(path: Path) -> set[str]:
    """Returns the functions, classes and variables that a file defines at any depth."""
    names: set[str] = set()
    for node in ast.walk(syntax_of(path)):
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
                names.add(name)
            case ast.ClassDef(name=name) | ast.Name(id=name, ctx=ast.Store()):
                names.add(name)
    return names


def strings_of(path: Path) -> set[str]:
    """Returns the strings in a file, among them what its tests have as parameters."""
    nodes = ast.walk(syntax_of(path))
    return {n.value for n in nodes if isinstance(n, ast.Constant) and isinstance(n.value, str)}


def modules_imported(nodes: Iterable[ast.AST]) -> Iterator[str]:
    """Yields the module of each import among the nodes."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        if isinstance(node, ast.ImportFrom):
            yield node.module or "."
