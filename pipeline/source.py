"""A Python module by its top-level names, parsed and never imported."""

import ast
import functools
import importlib.util
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

Symbol = tuple[str, ...]
"""A module, and the names to follow inside it."""


@dataclass(frozen=True, slots=True)
class Source:
    """One module, without its docstrings.

    Attributes:
        package: What its relative imports start from.
        bindings: The statements that make each top-level function, class and constant.
        imports: What each imported name stands for.
        effects: All other statements, which run whatever is used of the module.
    """

    package: str
    bindings: Mapping[str, list[ast.stmt]]
    imports: Mapping[str, Symbol]
    effects: list[ast.stmt]


def read_source(module: str) -> Source | None:
    """The source of a module; None where there is none, such as for a name inside a module."""
    root, *rest = module.split(".")
    spec = importlib.util.find_spec(root)  # of a top-level name, this imports nothing
    if spec is None:
        return None
    locations = spec.submodule_search_locations
    paths = [Path(location, *rest) for location in locations or []]
    candidates = [
        file for path in paths for file in (path / "__init__.py", path.with_suffix(".py"))
    ]
    if locations is None and spec.origin and not rest:
        candidates = [Path(spec.origin)]
    for file in candidates:
        if file.suffix == ".py" and file.is_file():
            return _parse(file, module, file.stat().st_mtime_ns, file.stat().st_size)
    return None


def imports_in(node: ast.AST, package: str) -> Iterator[tuple[str, Symbol]]:
    """The names that the import statements anywhere in `node` bind, and what they stand for."""
    for part in ast.walk(node):
        if isinstance(part, ast.Import):
            for alias in part.names:
                whole, top = alias.name, alias.name.split(".")[0]
                yield (alias.asname, (whole,)) if alias.asname else (top, (top,))
        elif isinstance(part, ast.ImportFrom):
            parents = package.split(".") if part.level else []
            base = parents[: len(parents) - part.level + 1]
            module = ".".join([*base, part.module] if part.module else base)
            for alias in part.names:
                yield alias.asname or alias.name, (module, alias.name)


@functools.cache
def _parse(file: Path, name: str, _mtime_ns: int, _size: int) -> Source:
    tree = ast.parse(file.read_bytes())
    _strip_docstrings(tree)
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    bindings: dict[str, list[ast.stmt]] = {}
    imports: dict[str, Symbol] = {}
    effects: list[ast.stmt] = []
    for statement in tree.body:
        if names := names_bound_by(statement):
            for bound in names:
                bindings.setdefault(bound, []).append(statement)
            continue
        imports |= imports_in(statement, package)
        if not isinstance(statement, ast.Import | ast.ImportFrom):
            effects.append(statement)
    return Source(package, bindings, imports, effects)


def _strip_docstrings(tree: ast.AST) -> None:
    """Drop every statement that is nothing but a string."""
    for node in ast.walk(tree):
        if isinstance(body := getattr(node, "body", None), list):
            body[:] = [part for part in body if not _is_string(part)] or [ast.Pass()]


def _is_string(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def names_bound_by(statement: ast.stmt) -> set[str]:
    """The names a simple statement makes or alters: `NAME = 1`, `NAME[i] += 1`, `def name`."""
    match statement:
        case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
            return {name}
        case ast.Assign(targets=targets):
            pass
        case ast.AnnAssign(target=target) | ast.AugAssign(target=target):
            targets = [target]
        case _:
            return set()
    return {
        part.id for target in targets for part in ast.walk(target) if isinstance(part, ast.Name)
    }
